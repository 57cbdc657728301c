"""The law "micro-inertia" at one material point. There are no gradients, so l_m is the only length that acts."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.materials.hyperelastic.evaluation import symmetric_tensors
from parsolid.materials.plastic import micro_inertia as laws
from parsolid.materials.plastic import micro_inertia_solve as solve
from parsolid.materials.plastic.micro_inertia import returned_deviator
from parsolid.materials.plastic.tile_update import deviatoric_strain
from parsolid.point.laws import PathLost, PointLaw
from parsolid.tensors import combine_symmetric, congruence, contract_symmetric, spin_rotation
from parsolid.tiles import TILE


class MicroInertiaState(NamedTuple):
    """F (3, 3), Cauchy deviator S (6,), tau = |S|, v^p, pi, gamma, T; dissipated and heat given away [J/m^3] since time
    0, per reference volume.
    """

    F: np.ndarray
    deviator: tuple[float, ...]
    tau: float
    rate: float
    stress: float
    gamma: float
    temperature: float
    dissipated: float
    heat: float


class MicroInertiaPoint(PointLaw):
    """Micro-inertia solid, adiabatic or isothermal; temperature [K]: of the undeformed state, T_r where it is None."""

    def __init__(self, law: laws.MicroInertia, temperature: float | None = None, isothermal: bool = False) -> None:
        self.law, self.isothermal, self.tile = laws.in_numbers(law), isothermal, solve.new_tile()
        self.start = law.reference_temperature if temperature is None else temperature

    def initial_state(self) -> MicroInertiaState:
        return MicroInertiaState(
            np.eye(3), (0.0,) * 6, 0.0, 0.0, self.law.initial_micro_stress, 0.0, self.start, 0.0, 0.0
        )

    def updated(self, state: MicroInertiaState, F: np.ndarray, step: float) -> MicroInertiaState:
        if step == 0.0:
            raise PathLost("the path jumps, and plastic flow takes time; give it a short ramp")
        law = self.law
        # of the middle: exact for a uniform shear rate, of second order else
        gradient = tuple(((F - state.F) @ np.linalg.inv(0.5 * (F + state.F)) / step).ravel().tolist())
        turn = spin_rotation(gradient, step)
        turned = congruence(turn, state.deviator)
        trial = combine_symmetric(1.0, turned, 2.0 * law.shear_modulus, deviatoric_strain(turn, gradient, step))
        J = float(np.linalg.det(F))
        middle, rows = 0.5 * (J + float(np.linalg.det(state.F))), self.tile.reshape(solve.ROWS, TILE)
        # without gradients FORCE, CURL and GRADIENT_SQUARE stay 0
        start = (state.rate, state.stress, state.gamma, 0.0, state.temperature)
        tau = contract_symmetric(trial, trial) ** 0.5
        rows[solve.DENSITY : solve.FORCE, 0] = (law.density / middle, state.tau, tau, *start)
        solve.advance_micro(law, solve.increments_of(law, step), self.tile)
        rate, mean, tau, stress, heat, _ = rows[solve.NEW_RATE : solve.LOST + 1, 0].tolist()
        deviator = returned_deviator(turned, trial, state.tau, tau, law.shear_modulus * mean * step)
        heat *= middle
        warmed = heat / (law.density * law.specific_heat)
        temperature, given = (state.temperature, heat) if self.isothermal else (state.temperature + warmed, 0.0)
        new = MicroInertiaState(
            F, deviator, tau, rate, stress, state.gamma + mean * step, temperature,
            state.dissipated + heat, state.heat + given,
        )  # fmt: skip
        if not np.isfinite(new[2:]).all():
            raise PathLost(f"the state is no number at J = {J:g}")
        return new

    def stress(self, state: MicroInertiaState) -> np.ndarray:
        J = np.linalg.det(state.F)
        cauchy = symmetric_tensors(np.array(state.deviator)) - laws.pressure(self.law, 1.0 / J) * np.eye(3)
        result: np.ndarray = J * cauchy @ np.linalg.inv(state.F).T
        return result

    def energies(self, states: list[Any]) -> np.ndarray:
        """Elastic energy and that of the micro-inertia, per reference volume."""
        return np.array([self._energy(state) for state in states])

    def _energy(self, state: MicroInertiaState) -> float:
        law, J = self.law, float(np.linalg.det(state.F))
        elastic = J * laws.deviatoric_energy(law, state.tau) + law.density * laws.volumetric_energy(law, 1.0 / J)
        return elastic + J * laws.micro_kinetic_energy(law, law.density / J, state.rate)

    def dissipated(self, before: MicroInertiaState, after: MicroInertiaState, step: float) -> float:
        return after.dissipated - before.dissipated

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        """Waves are elastic and the same in all directions."""
        names = {"rate": "plastic_strain_rate", "stress": "micro_stress"}
        names |= {"gamma": "plastic_strain", "temperature": "temperature", "heat": "heat_given_away"}
        result = {name: np.array([getattr(state, key) for state in states]) for key, name in names.items()}
        result["von_mises_stress"] = np.sqrt(1.5) * np.array([state.tau for state in states])
        law, J = self.law, np.linalg.det(self.deformations(states))
        mu = np.full(len(states), law.shear_modulus)
        modulus = law.bulk_modulus / J + 4.0 / 3.0 * mu
        micro = [J_ * laws.micro_kinetic_energy(law, law.density / J_, s.rate) for J_, s in zip(J, states)]
        return result | {
            "micro_kinetic_energy": np.array(micro),
            "largest_pressure_wave_speed": np.sqrt(modulus * J / law.density),
            "largest_shear_wave_speed": np.sqrt(mu * J / law.density),
            "smallest_acoustic_eigenvalue": np.minimum(mu, modulus),
        }
