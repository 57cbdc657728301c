"""Laws at one material point: what the driver asks of a law, and hyperelastic laws.

A new kind of law is one class more with the methods of `PointLaw`, entered in `point.choice` under the type of its
parameters; every hyperelastic law is one already. A class keeps the state of one point and calls the functions of the
law; it repeats none of them.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.materials.hyperelastic import acoustics, evaluation
from parsolid.materials.hyperelastic.evaluation import symmetric_rows, symmetric_tensors
from parsolid.materials.viscoelastic.relaxation import branch_states, dissipated_energy, relaxed_branches
from parsolid.scene.probes import component_names


class PathLost(ArithmeticError):
    """The path cannot be followed; the message says where and why."""


class PointLaw:
    """A law whose state is advanced along a deformation gradient. A state is what the law wants, with F (3, 3) as its
    attribute `F`, but never changed."""

    def initial_state(self) -> Any:
        """The state before time 0, at F = I."""
        raise NotImplementedError

    def updated(self, state: Any, F: np.ndarray, step: float) -> Any:
        """The state after a step [s] that ends at F (3, 3); a step of length 0 is a jump."""
        raise NotImplementedError

    def stress(self, state: Any) -> np.ndarray:
        """First Piola-Kirchhoff stress P [Pa] (3, 3)."""
        raise NotImplementedError

    def energies(self, states: list[Any]) -> np.ndarray:
        """Stored energy densities W [J/m^3] (n,) of n states."""
        raise NotImplementedError

    def dissipated(self, before: Any, after: Any, step: float) -> float:
        """Energy density [J/m^3] dissipated over the step between two states; never negative."""
        raise NotImplementedError

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        """Everything else that is told of n states, (n,) each: internal variables, energies, rates, wave speeds."""
        raise NotImplementedError

    def deformations(self, states: list[Any]) -> np.ndarray:
        """F (n, 3, 3) of n states."""
        return np.array([state.F for state in states])


def wave_columns(along: np.ndarray, extreme: np.ndarray, density: float) -> dict[str, np.ndarray]:
    """Columns of wave speeds from rho0 c^2 [Pa].

    along: (k, n, 3) of the three waves along k directions, the slowest first; extreme: (n, 3) over all directions, of
    the slowest wave the least, of the faster shear wave and of the pressure wave the greatest.
    """
    result = {}
    for k, moduli in enumerate(along, 1):
        speeds = np.sqrt(np.maximum(moduli, 0.0) / density).T
        for kind, column in zip(("slow_shear", "fast_shear", "pressure"), speeds):
            result[f"direction_{k}.{kind}_wave_speed"] = column
    # a search finds the extreme to round-off at best
    shear, pressure = (np.max([extreme[:, c], *along[:, :, c]], axis=0) for c in (1, 2))
    result["largest_pressure_wave_speed"] = np.sqrt(np.maximum(pressure, 0.0) / density)
    result["largest_shear_wave_speed"] = np.sqrt(np.maximum(shear, 0.0) / density)
    return result | {"smallest_acoustic_eigenvalue": np.min([extreme[:, 0], *along[:, :, 0]], axis=0)}


class MaxwellState(NamedTuple):
    """F (3, 3), C^{-1} (1, 6) and A_alpha (m, 6), rows 11, 22, 33, 12, 13, 23."""

    F: np.ndarray
    inverse: np.ndarray
    A: np.ndarray


class MaxwellPoint(PointLaw):
    """Hyperelastic solid with Maxwell branches; A is advanced by the second-order relaxation of the solver."""

    def __init__(self, law: Any) -> None:
        self.law = law
        self.moduli, self.times = np.array(law.branch_moduli or (), float), np.array(law.relaxation_times or (), float)

    def initial_state(self) -> MaxwellState:
        identity = symmetric_rows(np.eye(3))
        return MaxwellState(np.eye(3), identity, np.repeat(identity, len(self.moduli), axis=0))

    def updated(self, state: MaxwellState, F: np.ndarray, step: float) -> MaxwellState:
        inverse = symmetric_rows(np.linalg.inv(F.T @ F))
        return MaxwellState(F, inverse, relaxed_branches(state.A, state.inverse, inverse, step, self.times))

    def stress(self, state: MaxwellState) -> np.ndarray:
        return evaluation.stresses(self.law, state.F, self._branch_sum(state.A))

    def energies(self, states: list[Any]) -> np.ndarray:
        stored, _ = self._branches(states)
        return evaluation.energies(self.law, self.deformations(states)) + stored.sum(axis=1)

    def dissipated(self, before: MaxwellState, after: MaxwellState, step: float) -> float:
        return dissipated_energy(before.A, before.inverse, after.inverse, step, self.moduli, self.times)

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        F, A = self.deformations(states), np.array([state.A for state in states])
        stored, rates = self._branches(states)
        result = {"equilibrium": evaluation.energies(self.law, F), "dissipation_rate": rates.sum(axis=1)}
        tensors, names = symmetric_tensors(A), component_names("deformation_gradient", 3)
        for alpha in range(len(self.moduli)):
            branch = f"branch_{alpha + 1}."
            for c, name in enumerate(names):
                if c // 3 <= c % 3:
                    result[f"{branch}A_{name[-2:]}"] = tensors[:, alpha, c // 3, c % 3]
            result[f"{branch}strain_energy"], result[f"{branch}dissipation_rate"] = stored[:, alpha], rates[:, alpha]
        viscous = self._branch_sum(A)
        along = [acoustics.wave_moduli(self.law, F, N / np.linalg.norm(N), viscous) for N in directions]
        extreme = acoustics.extreme_moduli(self.law, F, viscous)
        return result | wave_columns(np.reshape(along, (-1, len(F), 3)), extreme, self.law.density)

    def _branch_sum(self, A: np.ndarray) -> np.ndarray | None:
        """sum mu_alpha A_alpha [Pa] (..., 3, 3) of A (..., m, 6)."""
        return symmetric_tensors(np.einsum("a,...ac->...c", self.moduli, A)) if len(self.moduli) else None

    def _branches(self, states: list[Any]) -> tuple[np.ndarray, np.ndarray]:
        """Stored energies [J/m^3] and rates of dissipation [W/m^3] (n, m) of the branches."""
        F, A = self.deformations(states), np.array([state.A for state in states])
        stored, rates = np.zeros(A.shape[:2]), np.zeros(A.shape[:2])
        C = symmetric_rows(np.swapaxes(F, 1, 2) @ F)
        branch_states(self.moduli, self.times, C, A, stored, rates)
        return stored, rates
