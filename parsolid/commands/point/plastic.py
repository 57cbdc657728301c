"""Elastic-plastic solids at one material point, advanced by the particle kernel of the material point method."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.commands.point.laws import PathLost
from parsolid.materials.failure.failure import count_of
from parsolid.materials.hyperelastic.evaluation import general_rows
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.methods.mpm.plastic_stress import advance_stress, new_state
from parsolid.numerics.lanes import WIDTH


class PlasticState(NamedTuple):
    """F (3, 3), unrotated deviator (6,), scalars, Cauchy stress (3, 3).

    plastic_work, with what failure released, and heat given away [J/m^3] since time 0; damage (1 + criteria,), the
    largest and that of each criterion, (0,) of a law that does not fail.
    """

    F: np.ndarray
    deviator: np.ndarray
    plastic_strain: float
    plastic_strain_rate: float
    energy: float
    temperature: float
    stress: np.ndarray
    plastic_work: float
    heat: float
    damage: np.ndarray


class PlasticPoint:
    """Elastic-plastic solid, adiabatic, or isothermal: then all heat is given away, plastic heat included.

    temperature [K]: of the undeformed state, free of stress unless it was heated from the law's reference at
    constant_volume; the reference temperature where it is None.
    """

    def __init__(
        self,
        law: ElasticPlastic,
        temperature: float | None = None,
        isothermal: bool = False,
        constant_volume: bool = False,
    ) -> None:
        self.law, self.isothermal = law, isothermal
        self.start = law.reference_temperature if temperature is None else temperature
        self.cold = law.reference_temperature if constant_volume else self.start
        self.share = law.taylor_quinney
        if isothermal:
            # the flow feels no warming within a step either
            self.law = law._replace(taylor_quinney=0.0)
        self.arrays = new_state(3, WIDTH, count_of(law.failure))
        self.motion, self.rate, self.record = np.zeros((WIDTH, 8)), np.zeros((WIDTH, 12)), np.zeros((WIDTH, 8))
        self.motion[:, 7] = 1.0

    def virgin(self) -> PlasticState:
        energy = self.law.internal_energy(self.start, self.cold)
        stress = -plastic_evaluation.pressure(self.law, 1.0, energy) * np.eye(3)
        whole = np.zeros(0 if self.law.failure is None else 1 + count_of(self.law.failure))
        return PlasticState(np.eye(3), np.zeros(6), 0.0, 0.0, energy, self.start, stress, 0.0, 0.0, whole)

    def advanced(self, state: PlasticState, F: np.ndarray, step: float) -> PlasticState:
        if step == 0.0:
            raise PathLost("the path jumps, and plastic flow takes time; give it a short ramp")
        arrays = self.arrays
        arrays.deformation[:, 0], arrays.deviator[:, 0] = general_rows(state.F)[0], state.deviator
        for scalar in ("plastic_strain", "energy", "temperature"):
            getattr(arrays, scalar)[0, 0] = getattr(state, scalar)
        if arrays.damage is not None and arrays.criterion_damage is not None:
            arrays.damage[0, 0], arrays.criterion_damage[:, 0] = state.damage[0], state.damage[1:]
        self.rate.reshape(-1, 3, 4)[0, :, :3] = (F - state.F) @ np.linalg.inv(state.F) / step
        outcome = advance_stress(3, 0, 1, self.law, step, None, arrays, self.motion, self.rate, self.record)
        sound, work = outcome[0], outcome[2]
        J = np.linalg.det(F)
        if not sound:
            raise PathLost(f"the state is lost at J = {J:g}: compressed beyond the equation of state, or not a number")
        energy, temperature, heat = arrays.energy[0, 0], arrays.temperature[0, 0], 0.0
        if self.isothermal:
            # of the flow, and of dE = T dS = -gamma rho0 C_v T dJ that keeps the temperature
            capacity = self.law.density * self.law.specific_heat_at(state.temperature)
            gamma = getattr(self.law.equation_of_state, "gamma", 0.0)
            heat = self.share * work - gamma * capacity * state.temperature * (J - np.linalg.det(state.F))
            energy, temperature = energy - heat, state.temperature
        xx, yy, zz, _, yz, xz, xy, _ = self.record[0] / J
        stress = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        damage = self._damage()
        pressure = plastic_evaluation.pressure(self.law, J, energy)
        if len(damage) and damage[0] >= 1.0:
            pressure = np.maximum(pressure, 0.0)
        # without the heat that has left
        stress -= (np.trace(stress) / 3.0 + pressure) * np.eye(3)
        ep = arrays.plastic_strain[0, 0]
        flow = (ep, (ep - state.plastic_strain) / step, energy, temperature, stress)
        done = (state.plastic_work + work + outcome[4], state.heat + heat)
        return PlasticState(F, arrays.deviator[:, 0].copy(), *flow, *done, damage)

    def _damage(self) -> np.ndarray:
        arrays = self.arrays
        if arrays.damage is None or arrays.criterion_damage is None:
            return np.zeros(0)
        return np.concatenate((arrays.damage[:, 0], arrays.criterion_damage[:, 0]))

    def stress(self, state: PlasticState) -> np.ndarray:
        return np.linalg.det(state.F) * state.stress @ np.linalg.inv(state.F).T

    def energies(self, states: list[Any]) -> np.ndarray:
        """What is neither dissipated nor given away as other heat than that of dissipation."""
        return np.array([state.energy + state.heat - state.plastic_work for state in states])

    def dissipated(self, before: PlasticState, after: PlasticState, step: float) -> float:
        return after.plastic_work - before.plastic_work

    def deformations(self, states: list[Any]) -> np.ndarray:
        return np.array([state.F for state in states])

    def columns(self, states: list[Any], directions: np.ndarray) -> dict[str, np.ndarray]:
        """Waves are elastic and the same in all directions."""
        names = {
            "plastic_strain": "plastic_strain",
            "plastic_strain_rate": "plastic_strain_rate",
            "temperature": "temperature",
        }
        names |= {"energy": "internal_energy", "heat": "heat_given_away"}
        result = {name: np.array([getattr(state, key) for state in states]) for key, name in names.items()}
        if self.law.failure is not None:
            result["damage"] = np.array([state.damage[0] for state in states])
        law, temperature = self.law, result["temperature"]
        J = np.linalg.det(self.deformations(states))
        pressure = plastic_evaluation.pressure(law, J, result["internal_energy"])
        mu = plastic_evaluation.shear_modulus(law, J, pressure, temperature)
        modulus = plastic_evaluation.isentropic_bulk_modulus(law, J, pressure) + 4.0 / 3.0 * mu
        arguments = (result["plastic_strain"], result["plastic_strain_rate"], temperature, J, pressure)
        return result | {
            "flow_stress": plastic_evaluation.flow_stress(law, *arguments),
            "shear_modulus": mu,
            "melting_temperature": plastic_evaluation.melting_temperature(law, J),
            "largest_pressure_wave_speed": np.sqrt(np.maximum(modulus, 0.0) * J / law.density),
            "largest_shear_wave_speed": np.sqrt(mu * J / law.density),
            "smallest_acoustic_eigenvalue": np.minimum(mu, modulus),
        }
