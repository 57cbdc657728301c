"""Elastic-plastic solids at one material point, advanced by the step of `materials.plastic.tile_update`."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.materials.failure.failure import count_of
from parsolid.materials.hyperelastic.evaluation import symmetric_tensors
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic import tile_update as update
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.methods.mpm.elastic_plastic import advance_deformation
from parsolid.point.laws import PathLost, PointLaw
from parsolid.tiles import TILE


class PlasticState(NamedTuple):
    """F (3, 3), unrotated deviator and back stress (6,), plastic volume strains (2,), scalars, Cauchy stress (3, 3).

    plastic_work [J/m^3] since time 0: with the energy that failure released, without the energy that back stresses
    store; heat [J/m^3]: given away since time 0; damage (1 + criteria,): the largest and that of each criterion, (0,)
    of a law that does not fail.
    """

    F: np.ndarray
    deviator: np.ndarray
    back_stress: np.ndarray
    volume_flow: np.ndarray
    plastic_strain: float
    plastic_strain_rate: float
    energy: float
    temperature: float
    stress: np.ndarray
    plastic_work: float
    heat: float
    damage: np.ndarray


class PlasticPoint(PointLaw):
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
        self.tile = update.new_tile(count_of(law.failure))
        update.fill_idle(self.law, self.tile, 0)

    def initial_state(self) -> PlasticState:
        energy = self.law.internal_energy(self.start, self.cold)
        stress = -plastic_evaluation.pressure(self.law, 1.0, energy) * np.eye(3)
        whole = np.zeros(0 if self.law.failure is None else 1 + count_of(self.law.failure))
        return PlasticState(
            np.eye(3), np.zeros(6), np.zeros(6), np.zeros(2), 0.0, 0.0, energy, self.start, stress, 0.0, 0.0, whole
        )

    def updated(self, state: PlasticState, F: np.ndarray, step: float) -> PlasticState:
        if step == 0.0:
            raise PathLost("the path jumps, and plastic flow takes time; give it a short ramp")
        law, rows = self.law, self.tile.reshape(-1, TILE)
        rows[update.DEFORMATION : update.DEFORMATION + 9, 0] = state.F.ravel()
        gradient = (F - state.F) @ np.linalg.inv(state.F) / step
        rows[update.VELOCITY_GRADIENT : update.VELOCITY_GRADIENT + 9, 0] = gradient.ravel()
        rows[update.DEVIATOR : update.DEVIATOR + 6, 0] = state.deviator
        rows[update.BACK_STRESS : update.BACK_STRESS + 6, 0] = state.back_stress
        rows[update.PLASTIC_VOLUME : update.PLASTIC_VOLUME + 2, 0] = state.volume_flow
        rows[update.PLASTIC_STRAIN, 0], rows[update.ENERGY, 0] = state.plastic_strain, state.energy
        rows[update.TEMPERATURE, 0] = state.temperature
        if len(state.damage):
            rows[update.DAMAGE, 0], rows[update.CRITERIA :, 0] = state.damage[0], state.damage[1:]
        advance_deformation(step, None, self.tile)
        update.start_step(law, law.failure, self.tile)
        update.flow(law, law.failure, step, self.tile)
        update.finish_step(law, law.failure, step, self.tile)
        J = np.linalg.det(F)
        if not rows[update.ROOM, 0] > 0.0:
            raise PathLost(f"the state is lost at J = {J:g}: compressed beyond the equation of state, or not a number")
        work, released = rows[update.PLASTIC_WORK, 0] - rows[update.BACK_STRESS_ENERGY, 0], rows[update.RELEASED, 0]
        energy, temperature, heat = rows[update.ENERGY, 0], rows[update.TEMPERATURE, 0], 0.0
        if self.isothermal:
            # of the flow, and of dE = T dS = -gamma rho0 C_v T dJ that keeps the temperature
            capacity = self.law.density * self.law.specific_heat_at(state.temperature)
            gamma = getattr(self.law.equation_of_state, "gamma", 0.0)
            heat = self.share * work - gamma * capacity * state.temperature * (J - np.linalg.det(state.F))
            energy, temperature = energy - heat, state.temperature
        damage = np.zeros(0)
        if law.failure is not None:
            damage = np.append(rows[update.DAMAGE, 0], rows[update.CRITERIA :, 0])
        # without the heat that has left
        volumes = rows[update.PLASTIC_VOLUME : update.PLASTIC_VOLUME + 2, 0].copy()
        pressure = plastic_evaluation.pressure(law, J, energy, volumes[0])
        if len(damage) and damage[0] >= 1.0:
            pressure = np.maximum(pressure, 0.0)
        deviator, R = (
            rows[update.DEVIATOR : update.DEVIATOR + 6, 0].copy(),
            rows[update.ROTATION : update.ROTATION + 9, 0].reshape(3, 3),
        )
        stress = R @ symmetric_tensors(deviator) @ R.T - pressure * np.eye(3)
        ep = rows[update.PLASTIC_STRAIN, 0]
        flow = (ep, (ep - state.plastic_strain) / step, energy, temperature, stress)
        back = rows[update.BACK_STRESS : update.BACK_STRESS + 6, 0].copy()
        return PlasticState(
            F, deviator, back, volumes, *flow, state.plastic_work + work + released, state.heat + heat, damage
        )

    def stress(self, state: PlasticState) -> np.ndarray:
        return np.linalg.det(state.F) * state.stress @ np.linalg.inv(state.F).T

    def energies(self, states: list[Any]) -> np.ndarray:
        """Internal energy and heat given away less plastic work [J/m^3]: plastic work is the dissipation."""
        return np.array([state.energy + state.heat - state.plastic_work for state in states])

    def dissipated(self, before: PlasticState, after: PlasticState, step: float) -> float:
        return after.plastic_work - before.plastic_work

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
        volume = np.array([state.volume_flow[0] for state in states])
        pressure = plastic_evaluation.pressure(law, J, result["internal_energy"], volume)
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
