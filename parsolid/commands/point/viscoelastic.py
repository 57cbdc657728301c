"""Linear elastic and viscoelastic solids at one material point, at small and at finite strain."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.materials.hyperelastic.evaluation import symmetric_tensors
from parsolid.materials.viscoelastic import prony_evaluation as evaluation
from parsolid.materials.viscoelastic.prony import Prony, algorithmic_factor, branch_weights, dissipation_weights

# directions in which extreme wave speeds are looked for, on a spiral over the sphere
_DIRECTIONS = 2000
_NAMES = ("xx", "yy", "zz", "xy", "xz", "yz")


class PronyState(NamedTuple):
    """F (3, 3), the law's strain (6,) and the strains of the branches' springs (m, 6), rows 11, 22, 33, 12, 13, 23."""

    F: np.ndarray
    strain: np.ndarray
    branches: np.ndarray


class PronyPoint:
    """A Prony series in space; with small strain P is the stress of the symmetric part of F - I."""

    def __init__(self, law: Prony):
        self.law = law
        self.ratios, self.times = np.array(law.ratios or ()), np.array(law.relaxation_times or ())

    def virgin(self) -> PronyState:
        return PronyState(np.eye(3), np.zeros(6), np.zeros((len(self.times), 6)))

    def advanced(self, state: PronyState, F: np.ndarray, step: float) -> PronyState:
        strain = evaluation.strains(self.law, (F - np.eye(3))[None])[0]
        weights = np.array([branch_weights(step, time) for time in self.times]).reshape(-1, 2)
        branches = weights[:, :1] * state.branches + weights[:, 1:] * (strain - state.strain)
        return PronyState(F, strain, branches)

    def stress(self, state: PronyState) -> np.ndarray:
        S = self._stresses([state])[0]
        return S if self.law.finite_strain is None else state.F @ S

    def energies(self, states: list[Any]) -> np.ndarray:
        return self._equilibrium(states) + self._stored(states).sum(axis=1)

    def dissipated(self, before: PronyState, after: PronyState, step: float) -> float:
        start, change = before.branches, np.broadcast_to(after.strain - before.strain, before.branches.shape)
        pairs = ((start, start), (start, change), (change, change))
        forms = np.array([evaluation.branch_forms(self.law, *map(np.ascontiguousarray, pair)) for pair in pairs])
        weights = np.array([dissipation_weights(step, time) for time in self.times]).reshape(-1, 3)
        return float(np.sum(2.0 * self.ratios * np.sum(weights * forms.T, axis=1)))

    def deformations(self, states: list[Any]) -> np.ndarray:
        return np.array([state.F for state in states])

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        stored = self._stored(states)
        rates = 2.0 * stored / self.times
        result = {"equilibrium": self._equilibrium(states), "dissipation_rate": rates.sum(axis=1)}
        for j in range(len(self.times)):
            branch = f"branch_{j + 1}."
            result |= {
                f"{branch}strain_{name}": np.array([s.branches[j, c] for s in states]) for c, name in enumerate(_NAMES)
            }
            result[f"{branch}stored"], result[f"{branch}dissipation_rate"] = stored[:, j], rates[:, j]
        return result | self._waves(states, directions)

    def _stresses(self, states: list[Any]) -> np.ndarray:
        """sigma or S (n, 3, 3) [Pa]."""
        strain = np.array([state.strain for state in states])
        relaxing = strain + np.array([self.ratios @ state.branches for state in states])
        return symmetric_tensors(evaluation.stresses(self.law, strain, relaxing))

    def _equilibrium(self, states: list[Any]) -> np.ndarray:
        strain = np.array([state.strain for state in states])
        return evaluation.equilibrium_forms(self.law, strain, strain)

    def _stored(self, states: list[Any]) -> np.ndarray:
        """Energy densities (n, m) [J/m^3] of the branches."""
        branches = np.array([state.branches for state in states]).reshape(-1, 6)
        return self.ratios * evaluation.branch_forms(self.law, branches, branches).reshape(len(states), -1)

    def _waves(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        """Speeds of waves too fast for anything to relax; the extreme ones of many directions."""
        result, density = {}, self.law.density
        for k, N in enumerate(directions, 1):
            speeds = np.sqrt(
                np.maximum(self._acoustic_moduli(states, N[None] / np.linalg.norm(N))[:, 0], 0.0) / density
            )
            for c, kind in ((2, "pressure"), (0, "slow_shear"), (1, "fast_shear")):
                result[f"direction_{k}.{kind}_wave_speed"] = speeds[:, c]
        moduli = self._acoustic_moduli(
            states, _spiral(_DIRECTIONS) if self.law.finite_strain is not None else np.eye(3)[:1]
        )
        largest = np.sqrt(np.maximum(moduli.max(axis=1), 0.0) / density)
        result["largest_pressure_wave_speed"], result["largest_shear_wave_speed"] = largest[:, 2], largest[:, 1]
        result["smallest_acoustic_eigenvalue"] = moduli.min(axis=(1, 2))
        return result

    def _acoustic_moduli(self, states: list[Any], directions: np.ndarray) -> np.ndarray:
        """Rising eigenvalues (n, k, 3) [Pa] of the instantaneous acoustic tensors of unit directions (k, 3).

        Q = (N.S N) I + (lambda + G) F N (x) F N + G F F^T at finite strain, with F = I and S = 0 at small strain.
        """
        law: Any = self.law
        factor = algorithmic_factor(law, 0.0)
        G = law.shear_modulus * factor
        lame = law.first_lame * factor if law.bulk_modulus is None else law.bulk_modulus - 2.0 / 3.0 * G
        F, S = np.tile(np.eye(3), (len(states), 1, 1)), np.zeros((len(states), 3, 3))
        if law.finite_strain is not None:
            F, S = self.deformations(states), self._stresses(states)
        FN = np.einsum("nij,kj->nki", F, directions)
        Q = np.einsum("kj,njl,kl->nk", directions, S, directions)[..., None, None] * np.eye(3)
        Q = Q + (lame + G) * FN[..., :, None] * FN[..., None, :] + G * (F @ np.swapaxes(F, 1, 2))[:, None]
        return np.linalg.eigvalsh(Q)


def _spiral(count: int) -> np.ndarray:
    """Unit vectors (count, 3) spread evenly over the sphere."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    return np.stack([np.sqrt(1.0 - z * z) * np.cos(angle), np.sqrt(1.0 - z * z) * np.sin(angle), z], axis=1)
