"""Laws at one material point: the interface that the driver uses, and hyperelastic laws.

A new kind of law needs a class with the methods of `PointLaw`, entered in `driver.POINT_LAWS` under the type of its
parameters. Hyperelastic laws need none. A class keeps the state of one point and calls the functions of the law.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.materials.declaration import StateVariable
from parsolid.materials.hyperelastic import acoustics, evaluation, functions
from parsolid.materials.hyperelastic.at_particles import members, state_count
from parsolid.materials.hyperelastic.evaluation import symmetric_rows, symmetric_tensors
from parsolid.materials.viscoelastic.relaxation import branch_states, dissipated_energy, relaxed_branches
from parsolid.scene.probes import component_names


class PathLost(ArithmeticError):
    """The path cannot be followed; the message says where and why."""


class PointLaw:
    """A law whose state is advanced along a deformation gradient. A state is any object with F (3, 3) as its attribute
    `F`; it is never changed."""

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
        """Further columns of n states, (n,) each: internal variables, energies, rates, wave speeds."""
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
    """F (3, 3), C^{-1} (1, 6) and A_alpha (m, 6), rows 11, 22, 33, 12, 13, 23, and the law with its state variables."""

    F: np.ndarray
    inverse: np.ndarray
    A: np.ndarray
    law: Any


class MaxwellPoint(PointLaw):
    """Hyperelastic solid with Maxwell branches; A is advanced by the second-order relaxation of the solver."""

    def __init__(self, law: Any) -> None:
        self.law = law
        self.moduli, self.times = np.array(law.branch_moduli or (), float), np.array(law.relaxation_times or (), float)

    def initial_state(self) -> MaxwellState:
        identity = symmetric_rows(np.eye(3))
        return MaxwellState(np.eye(3), identity, np.repeat(identity, len(self.moduli), axis=0), self.law)

    def updated(self, state: MaxwellState, F: np.ndarray, step: float) -> MaxwellState:
        inverse = symmetric_rows(np.linalg.inv(F.T @ F))
        A = relaxed_branches(state.A, state.inverse, inverse, step, self.times)
        return MaxwellState(F, inverse, A, evaluation.after_step_to(state.law, F))

    def stress(self, state: MaxwellState) -> np.ndarray:
        return evaluation.stresses(state.law, state.F, self._branch_sum(state.A))

    def energies(self, states: list[Any]) -> np.ndarray:
        stored, _ = self._branches(states)
        return self._equilibrium(states) + stored.sum(axis=1)

    def dissipated(self, before: MaxwellState, after: MaxwellState, step: float) -> float:
        of_branches = dissipated_energy(before.A, before.inverse, after.inverse, step, self.moduli, self.times)
        of_states = float(functions.dissipated_energy(after.law) - functions.dissipated_energy(before.law))
        return of_branches + of_states

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        F, A = self.deformations(states), np.array([state.A for state in states])
        stored, rates = self._branches(states)
        result = {"equilibrium": self._equilibrium(states), "dissipation_rate": rates.sum(axis=1)}
        for one in members(self.law):
            if isinstance(one.note, StateVariable):
                result[one.name] = np.array([getattr(state.law, one.name) for state in states])
        tensors, names = symmetric_tensors(A), component_names("deformation_gradient", 3)
        for alpha in range(len(self.moduli)):
            branch = f"branch_{alpha + 1}."
            for c, name in enumerate(names):
                if c // 3 <= c % 3:
                    result[f"{branch}A_{name[-2:]}"] = tensors[:, alpha, c // 3, c % 3]
            result[f"{branch}strain_energy"], result[f"{branch}dissipation_rate"] = stored[:, alpha], rates[:, alpha]
        viscous = self._branch_sum(A)
        along, extreme = self._waves(states, F, directions, viscous)
        return result | wave_columns(np.reshape(along, (-1, len(F), 3)), extreme, self.law.density)

    def _equilibrium(self, states: list[Any]) -> np.ndarray:
        """Stored energy without branches [J/m^3] (n,)."""
        if state_count(self.law):
            return np.array([evaluation.energies(state.law, state.F) for state in states])
        return evaluation.energies(self.law, self.deformations(states))

    def _waves(self, states: list[Any], F: np.ndarray, directions: np.ndarray, viscous: Any) -> tuple[Any, np.ndarray]:
        """rho c^2 [Pa] along directions (k, n, 3), and `acoustics.extreme_moduli` (n, 3)."""
        parts = [(state.law, slice(i, i + 1)) for i, state in enumerate(states)] if state_count(self.law) else []
        along, extreme = [], []
        for law, part in parts or [(self.law, slice(None))]:
            of_branches = None if viscous is None else viscous[part]
            found = [acoustics.wave_moduli(law, F[part], N / np.linalg.norm(N), of_branches) for N in directions]
            along.append(np.reshape(found, (len(directions), -1, 3)))
            extreme.append(acoustics.extreme_moduli(law, F[part], of_branches))
        return np.concatenate(along, axis=1), np.concatenate(extreme)

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
