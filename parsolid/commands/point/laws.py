"""Laws at one material point: what the driver asks of a law, and the laws that answer.

A new law is one class more with the methods of `PointLaw`, entered in `point.choice` under the type of its parameters;
every hyperelastic law is one already.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from parsolid.materials.hyperelastic import acoustics, evaluation, hyperbolicity
from parsolid.materials.hyperelastic.conjugates import branch_moduli, relaxation_times
from parsolid.materials.hyperelastic.evaluation import symmetric_rows, symmetric_tensors
from parsolid.materials.viscoelastic.relaxation import dissipated_energy, relax_branches
from parsolid.scene.probes import component_names


class PathLost(ArithmeticError):
    """The path cannot be followed; the message says where and why."""


class PointLaw(Protocol):
    """A law whose state is advanced along a deformation gradient. A state is what the law wants, but never changed."""

    def virgin(self) -> Any:
        """The state before time 0, at F = I."""

    def advanced(self, state: Any, F: np.ndarray, step: float) -> Any:
        """The state after a step [s] that ends at F (3, 3); a step of length 0 is a jump."""

    def stress(self, state: Any) -> np.ndarray:
        """First Piola-Kirchhoff stress P [Pa] (3, 3)."""

    def energies(self, states: list[Any]) -> np.ndarray:
        """Stored energy densities W [J/m^3] (n,) of n states."""

    def dissipated(self, before: Any, after: Any, step: float) -> float:
        """Energy density [J/m^3] dissipated over the step between two states; never negative."""

    def deformations(self, states: list[Any]) -> np.ndarray:
        """F (n, 3, 3) of n states."""

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        """Everything else that is told of n states, (n,) each: internal variables, energies, rates, wave speeds."""


class MaxwellState(NamedTuple):
    """F (3, 3), C^{-1} (6,) and A_alpha (m, 6), rows 11, 22, 33, 12, 13, 23."""

    F: np.ndarray
    inverse: np.ndarray
    A: np.ndarray


class MaxwellPoint:
    """Hyperelastic solid with Maxwell branches; A is advanced by the second-order relaxation of the solver."""

    def __init__(self, law: Any) -> None:
        self.law, self.moduli, self.times = law, branch_moduli(law), relaxation_times(law)

    def virgin(self) -> MaxwellState:
        identity = symmetric_rows(np.eye(3))
        return MaxwellState(np.eye(3), identity[0], np.repeat(identity, len(self.moduli), axis=0))

    def advanced(self, state: MaxwellState, F: np.ndarray, step: float) -> MaxwellState:
        inverse, A = symmetric_rows(np.linalg.inv(F.T @ F))[0], np.empty_like(state.A)
        relax_branches(state.A, state.inverse, inverse, step, self.times, A)
        return MaxwellState(F, inverse, A)

    def stress(self, state: MaxwellState) -> np.ndarray:
        F, viscous = state.F, None
        if len(self.moduli):
            viscous = symmetric_tensors(self.moduli @ state.A)
        return evaluation.first_piola_kirchhoff_stress(self.law, F, evaluation.cofactor(F), np.linalg.det(F), viscous)

    def energies(self, states: list[Any]) -> np.ndarray:
        return hyperbolicity.energy(self.law, self._polyconvex(states))

    def dissipated(self, before: MaxwellState, after: MaxwellState, step: float) -> float:
        return dissipated_energy(before.A, before.inverse, after.inverse, step, self.moduli, self.times)

    def deformations(self, states: list[Any]) -> np.ndarray:
        return np.array([state.F for state in states])

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        state = self._polyconvex(states)
        equilibrium, viscous = hyperbolicity.energies(self.law, state)
        rates = hyperbolicity.dissipation_rates(self.law, state)
        result = {"equilibrium": equilibrium, "dissipation_rate": rates.sum(axis=1)}
        A, names = symmetric_tensors(np.array([s.A for s in states])), component_names("deformation_gradient", 3)
        for alpha in range(len(self.moduli)):
            branch = f"branch_{alpha + 1}."
            for c, name in enumerate(names):
                if c // 3 <= c % 3:
                    result[f"{branch}A_{name[-2:]}"] = A[:, alpha, c // 3, c % 3]
            result[f"{branch}stored"], result[f"{branch}dissipation_rate"] = viscous[:, alpha], rates[:, alpha]
        return result | self._waves(state, directions)

    def _waves(self, state: Any, directions: np.ndarray) -> dict[str, np.ndarray]:
        result = {}
        for k, N in enumerate(directions, 1):
            speeds = np.sqrt(acoustics.wave_moduli(self.law, state, N / np.linalg.norm(N)) / self.law.density)
            result[f"direction_{k}.pressure_wave_speed"] = speeds[:, 2]
            result[f"direction_{k}.slow_shear_wave_speed"], result[f"direction_{k}.fast_shear_wave_speed"] = speeds.T[
                :2
            ]
        least, shear, greatest = acoustics.extreme_moduli(self.law, state).T
        result["largest_pressure_wave_speed"] = np.sqrt(greatest / self.law.density)
        result["largest_shear_wave_speed"] = np.sqrt(shear / self.law.density)
        return result | {"smallest_acoustic_eigenvalue": least}

    def _polyconvex(self, states: list[Any]) -> Any:
        A = symmetric_tensors(np.array([state.A for state in states])) if len(self.moduli) else None
        return hyperbolicity.polyconvex_state(self.law, self.deformations(states), A)


class MooneyRivlinPoint(MaxwellPoint):
    """The solid whose waves have closed forms."""

    def _waves(self, state: Any, directions: np.ndarray) -> dict[str, np.ndarray]:
        result = {}
        for k, N in enumerate(directions, 1):
            shear = hyperbolicity.shear_wave_speeds(self.law, state, N)
            result[f"direction_{k}.pressure_wave_speed"] = hyperbolicity.pressure_wave_speed(self.law, state, N)
            result[f"direction_{k}.slow_shear_wave_speed"], result[f"direction_{k}.fast_shear_wave_speed"] = shear.T
        result["largest_pressure_wave_speed"] = hyperbolicity.largest_wave_speed(self.law, state)
        result["largest_shear_wave_speed"] = hyperbolicity.largest_shear_wave_speed(self.law, state)
        result["smallest_acoustic_eigenvalue"] = hyperbolicity.smallest_acoustic_eigenvalue(self.law, state)
        return result
