"""Linear elastic and viscoelastic solids at one material point, at small and at finite strain."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.materials.hyperelastic.evaluation import symmetric_tensors
from parsolid.materials.viscoelastic import prony
from parsolid.materials.viscoelastic.prony import Prony, branch_weights, dissipation_weights
from parsolid.point.laws import PointLaw, wave_columns

# directions in which extreme wave speeds are looked for, on a spiral over the sphere
_DIRECTIONS = 2000
_NAMES = ("xx", "yy", "zz", "xy", "xz", "yz")


class PronyState(NamedTuple):
    """F (3, 3), the law's strain (6,) and the strains of the branches' springs (m, 6), rows 11, 22, 33, 12, 13, 23."""

    F: np.ndarray
    strain: np.ndarray
    branches: np.ndarray


class PronyPoint(PointLaw):
    """A Prony series in space; with small strain P is the stress of the symmetric part of F - I."""

    def __init__(self, law: Prony):
        self.law, self.solid = law, prony.linear_solid(law)
        self.ratios, self.times = np.array(law.ratios or ()), np.array(law.relaxation_times or ())

    def initial_state(self) -> PronyState:
        return PronyState(np.eye(3), np.zeros(6), np.zeros((len(self.times), 6)))

    def updated(self, state: PronyState, F: np.ndarray, step: float) -> PronyState:
        strain = np.array(prony.strain_of(self.solid, tuple((F - np.eye(3)).ravel())))
        weights = np.array([branch_weights(step, time) for time in self.times]).reshape(-1, 2)
        branches = weights[:, :1] * state.branches + weights[:, 1:] * (strain - state.strain)
        return PronyState(F, strain, branches)

    def stress(self, state: PronyState) -> np.ndarray:
        S = self._stresses([state])[0]
        return state.F @ S if self.solid.finite else S

    def energies(self, states: list[Any]) -> np.ndarray:
        return self._equilibrium(states) + self._stored(states).sum(axis=1)

    def dissipated(self, before: PronyState, after: PronyState, step: float) -> float:
        lost, change = 0.0, tuple(after.strain - before.strain)
        for ratio, time, branch in zip(self.ratios, self.times, before.branches):
            weights, start = dissipation_weights(step, time), tuple(branch)
            pairs = ((start, start), (start, change), (change, change))
            lost += 2.0 * ratio * sum(w * prony.branch_form(self.solid, *pair) for w, pair in zip(weights, pairs))
        return float(lost)

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        stored = self._stored(states)
        rates = 2.0 * stored / self.times
        result = {"equilibrium": self._equilibrium(states), "dissipation_rate": rates.sum(axis=1)}
        for j in range(len(self.times)):
            branch = f"branch_{j + 1}."
            result |= {
                f"{branch}strain_{name}": np.array([s.branches[j, c] for s in states]) for c, name in enumerate(_NAMES)
            }
            result[f"{branch}strain_energy"], result[f"{branch}dissipation_rate"] = stored[:, j], rates[:, j]
        units = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        along = np.moveaxis(self._acoustic_moduli(states, units.reshape(-1, 3)), 1, 0)
        moduli = self._acoustic_moduli(states, _spiral(_DIRECTIONS) if self.solid.finite else np.eye(3)[:1])
        largest = moduli.max(axis=1)
        extreme = np.stack([moduli.min(axis=(1, 2)), largest[:, 1], largest[:, 2]], axis=1)
        return result | wave_columns(along, extreme, self.law.density)

    def _stresses(self, states: list[Any]) -> np.ndarray:
        """sigma or S (n, 3, 3) [Pa]."""
        strain = np.array([state.strain for state in states])
        relaxing = strain + np.array([self.ratios @ state.branches for state in states])
        return symmetric_tensors(np.array(prony.linear_stress(self.solid, tuple(strain.T), tuple(relaxing.T))).T)

    def _equilibrium(self, states: list[Any]) -> np.ndarray:
        strain = tuple(np.array([state.strain for state in states]).T)
        return np.asarray(prony.equilibrium_form(self.solid, strain, strain))

    def _stored(self, states: list[Any]) -> np.ndarray:
        """Energy densities (n, m) [J/m^3] of the branches."""
        branches = tuple(np.moveaxis(np.array([state.branches for state in states]), -1, 0))
        return np.asarray(self.ratios * prony.branch_form(self.solid, branches, branches))

    def _acoustic_moduli(self, states: list[Any], directions: np.ndarray) -> np.ndarray:
        """Rising eigenvalues (n, k, 3) [Pa] of the acoustic tensors of unit directions (k, 3), for waves too fast for
        anything to relax.

        Q = (N.S N) I + (lambda + G) F N (x) F N + G F F^T at finite strain, with F = I and S = 0 at small strain.
        """
        # P-wave modulus and shear modulus before anything has relaxed
        G = self.solid.shear * prony.algorithmic_factor(self.law, 0.0)
        lame = self.solid.undeformed - 2.0 * G
        F, S = np.tile(np.eye(3), (len(states), 1, 1)), np.zeros((len(states), 3, 3))
        if self.solid.finite:
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
