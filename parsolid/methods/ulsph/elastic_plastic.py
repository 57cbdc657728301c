"""Elastic-plastic solids with an equation of state in updated-Lagrangian SPH: the state between the two sweeps.

The deviator is a Cauchy stress in Jaumann's rate; `materials.plastic.tile_update` returns it to the flow stress. Stored
energies hold the heat of plastic flow, of the artificial viscosity, and what conduction brings.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE
from parsolid.kernels import inlined, kernel
from parsolid.materials.failure.failure import count_of
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.tile_update import (
    BACK_STRESS,
    BACK_STRESS_ENERGY,
    DEVIATOR,
    HEAT,
    JACOBIAN,
    MIDDLE_JACOBIAN,
    NEW_JACOBIAN,
    PLASTIC_VOLUME,
    PLASTIC_WORK,
    PRESSURE,
    RELEASED,
    ROOM,
    SPEED,
    fill_idle,
    finish_step,
    flow,
    load_if_any,
    load_state,
    new_tile,
    start_step,
    store_if_any,
    store_state,
)
from parsolid.methods import plastic_fields
from parsolid.methods.failure_fields import FAILURE_DISSIPATION
from parsolid.methods.ulsph.heat import advance_heat_flux
from parsolid.methods.ulsph.kinematics import (
    CARRIED,
    CORRECTION,
    GROWTH,
    LAST,
    ROWS,
    carry_on_correction,
    find_gradients,
    load_rates,
    store_pair_stress,
    turn_deviator,
)
from parsolid.particles.container import Particles
from parsolid.particles.initial_fields import initial_zero_energy_temperature
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene
from parsolid.tiles import TILE, load_rows, store_rows


class State(NamedTuple):
    """Fields (components, particles) that every law has, see `state`; those that not all have, or None."""

    mass: np.ndarray
    density: np.ndarray
    correction: np.ndarray
    deviator: np.ndarray
    plastic_strain: np.ndarray
    energy: np.ndarray
    temperature: np.ndarray
    pair_stress: np.ndarray
    sound_speed: np.ndarray
    back_stress: np.ndarray | None = None
    volume_flow: np.ndarray | None = None


@inlined
def advance_density(density, reference, first, count, kinematics, tile):
    """Densities after a step, and Jacobians of its start, middle and end."""
    for p in range(count):
        a = first + p
        J, growth = reference / density[0, a], kinematics[GROWTH * TILE + p]
        tile[JACOBIAN * TILE + p] = J
        tile[MIDDLE_JACOBIAN * TILE + p] = J / growth
        tile[NEW_JACOBIAN * TILE + p] = J / (growth * growth)
        density[0, a] *= growth * growth


@inlined
def viscous_losses(step, mean_step, mass, force, viscous_force, heat, impulse_power, external, first, count, tile):
    """HEAT [J] of the artificial viscosity: the loss that its forces V are in both half kicks around their time, the
    halves of the step before and of this one, together mean_step [s].

    The sums q = -V.v are of velocities v half a step before these kicks, d and d' of which change v by d F/2m and
    d' F/2m with all forces F: -V.dv of both is h q - h^2 V.F/2m with h = (d + d')/2, also where d is 0. What impulses
    of contact change between them, w = V.dv, meets the second one alone. external: forces of contact, None without.
    """
    for p in range(count):
        a = first + p
        power = 0.0
        for c in range(force.shape[0]):
            acting = force[c, a] + viscous_force[c, a]
            if external is not None:
                acting += external[c, a]
            power += viscous_force[c, a] * acting
        loss = heat[0, a] - 0.5 * mean_step / mass[0, a] * power
        tile[HEAT * TILE + p] = mean_step * loss - 0.5 * step * impulse_power[0, a]


@kernel
def advance_state(
    first,
    last,
    law,
    failure,
    step,
    mean_step,
    most,
    centred,
    in_plane,
    rates,
    flows,
    state,
    viscosity,
    external,
    failing,
    strength,
    deleted,
    tile,
):
    """State of particles first..last-1 after a step [s] from the sums of the first sweep.

    most, in_plane: see `kinematics`; centred: not None where B is carried on from the middle of the step. None where
    there is no such thing: flows, of heat; viscosity: force, viscous_force, viscous_heat, impulse_power; external:
    forces of contact; failing: damage, criterion_damage; strength, its factors; deleted, masses. tile: of
    `tile_update`, for the law. Returns (sound, plastic work, viscous heat, energy that failure released, what of the
    plastic work back stresses store) [J]; sound: no particle is compressed beyond its equation of state, and all are
    numbers.
    """
    sound, plastic, viscous, released, stored = True, 0.0, 0.0, 0.0, 0.0
    kinematics, numbers = np.zeros(ROWS * TILE), (state.plastic_strain, state.energy, state.temperature)
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_rates(rates, state.mass, state.density, in_plane, deleted, i, count, kinematics)
        load_rows(state.correction, i, count, kinematics, LAST)
        load_rows(state.deviator, i, count, tile, DEVIATOR)
        load_state(numbers, failing, strength, i, count, tile)
        load_if_any(state.back_stress, i, count, tile, BACK_STRESS)
        load_if_any(state.volume_flow, i, count, tile, PLASTIC_VOLUME)
        fill_idle(law, tile, count)
        find_gradients(step, most, in_plane, kinematics)
        carry_on_correction(0.5 * step if centred is not None else 0.0, mean_step, kinematics)
        turn_deviator(step, kinematics, state.back_stress, tile)
        advance_density(state.density, law.density, i, count, kinematics, tile)
        start_step(law, failure, tile)
        tile[HEAT * TILE : (HEAT + 1) * TILE] = 0.0
        if viscosity is not None:
            viscous_losses(step, mean_step, state.mass, *viscosity, external, i, count, tile)
        for p in range(count):
            per_volume = law.density / state.mass[0, i + p]
            if deleted is None or deleted[0, i + p] <= 0.0:
                viscous += tile[HEAT * TILE + p]
            if flows is not None:
                tile[HEAT * TILE + p] -= step * flows[i + p, 1]
            tile[HEAT * TILE + p] *= per_volume
        flow(law, failure, step, tile)
        finish_step(law, failure, step, tile)
        store_rows(state.deviator, i, count, tile, DEVIATOR)
        store_state(numbers, failing, i, count, tile)
        store_if_any(state.back_stress, i, count, tile, BACK_STRESS)
        store_if_any(state.volume_flow, i, count, tile, PLASTIC_VOLUME)
        store_rows(state.sound_speed, i, count, tile, SPEED)
        store_rows(state.correction, i, count, kinematics, CORRECTION)
        store_pair_stress(tile, PRESSURE, kinematics, CARRIED, state.density, in_plane, i, count, state.pair_stress)
        for p in range(count):
            volume = state.mass[0, i + p] / law.density
            if deleted is None or deleted[0, i + p] <= 0.0:
                plastic += volume * tile[PLASTIC_WORK * TILE + p]
                stored += volume * tile[BACK_STRESS_ENERGY * TILE + p]
                released += volume * tile[RELEASED * TILE + p]
                sound = sound and tile[ROOM * TILE + p] > 0.0
    return sound, plastic, viscous, released, stored


class ElasticPlasticSolid:
    """Particles of one elastic-plastic law on a rank.

    stores_heat: stored energies hold heat, that of the viscosity too; speeds_change: speeds of sound follow the state;
    plastic_work, what of it back stresses have stored, viscous_heat, released (by failure) [J]: since `take_energies`.
    """

    stores_heat = speeds_change = True

    def __init__(self, law: ElasticPlastic):
        self.law = law
        self.flows = frozenset({"heat"} if law.conductivity else ())
        self.fields = frozenset({"energy", "heat_flux"} if law.conductivity else {"energy"})
        if plastic_fields.has_back_stress(law):
            self.fields |= {plastic_fields.BACK_STRESS}
        if plastic_fields.flows_in_volume(law):
            self.fields |= {plastic_fields.VOLUME_FLOW}
        self.plastic_work = self.viscous_heat = self.released = self.stored = 0.0
        self._tile = new_tile(count_of(law.failure))

    def begin(self, scene: Scene, particles: Particles, here: slice, particle_set: ParticleSet) -> None:
        """The internal energy that belongs to the temperatures at time 0."""
        of = particles.owned_rows
        warm = of("temperature")[here]
        cold = initial_zero_energy_temperature(scene, of("body")[here], warm, self.law.reference_temperature)
        of("energy")[here] = self.law.internal_energy(warm, cold)

    def advance(self, system: Any, here: slice, step: float) -> tuple[bool, float, float]:
        """The state after a step [s] from the sums of the first sweep: whether it is sound; heat of plastic flow and
        numerical loss [J] outside of stored energies, which are none."""
        particles, law, rates = system.particles, self.law, system.neighbours
        of = particles.storage
        state = State._make((*map(of, State._fields[:-2]), *plastic_fields.flow_state(particles, law)))
        viscosity = failing = strength = deleted = None
        external = of(EXTERNAL_FORCE) if EXTERNAL_FORCE in particles else None
        if system.viscosity is not None:
            viscosity = of("force"), of("viscous_force"), of("viscous_heat"), of("impulse_power")
        if law.failure is not None:
            failing = of("damage"), of("criterion_damage")[: count_of(law.failure)]
            strength = of("strength_factor") if "strength_factor" in particles else None
            deleted = of("deleted_mass") if "deleted_mass" in particles else None
        flows = rates.flows if "heat" in self.flows else None
        how = step, system.kicks.viscous_heat.mean_step(step), system.most_correction, system.centred, system.in_plane
        sound, plastic, viscous, released, stored = advance_state(
            here.start, here.stop, law, law.failure, *how, rates.rates, flows,
            state, viscosity, external, failing, strength, deleted, self._tile,
        )  # fmt: skip
        self.plastic_work += plastic
        self.viscous_heat += viscous
        self.released += released
        self.stored += stored
        return sound, 0.0, 0.0

    def advance_fluxes(self, system: Any, here: slice, step: float) -> float:
        """The heat flux from the sums of the second sweep; nothing is dissipated outside of stored energies."""
        if "heat" in self.flows:
            of = system.particles.storage
            fields = (of(name) for name in ("mass", "density", "correction", "heat_flux", "pair_heat_flux"))
            slopes, stride = system.neighbours.slopes, system.neighbours.stride
            advance_heat_flux(here.start, here.stop, self.law.conductivity, system.in_plane, stride, slopes, *fields)
        return 0.0

    def energies(self, particles: Particles, here: slice) -> tuple[float, float]:
        """No other kinetic energy than that of the velocity, and internal energy [J]."""
        of = particles.owned_rows
        return 0.0, float(of("energy")[here] @ of("mass")[here]) / self.law.density

    def stable_step(self, particles: Particles, here: slice) -> float:
        """rho C_v h^2/(2 kappa) [s] of conduction by Fourier; infinite without it."""
        if not self.law.conductivity:
            return float(np.inf)
        of = particles.owned_rows
        capacity = self.law.specific_heat_at(of("temperature")[here]) * of("density")[here]
        return float(0.5 * (capacity * of("smoothing_length")[here] ** 2).min() / self.law.conductivity)

    def pressures(self, particles: Particles, here: slice) -> np.ndarray:
        """P (n,) [Pa]."""
        of = particles.owned_rows
        volume = of(plastic_fields.VOLUME_FLOW)[here, 0] if plastic_fields.flows_in_volume(self.law) else 0.0
        return plastic_evaluation.pressure(self.law, self.law.density / of("density")[here], of("energy")[here], volume)

    def room(self, particles: Particles, here: slice) -> np.ndarray | None:
        """Room (n,) that the equation of state leaves to compress particles, see `room_to_compress`."""
        return plastic_evaluation.room_to_compress(self.law, self.law.density / particles.owned_rows("density")[here])

    @property
    def sound_speed(self) -> float:
        """c_L [m/s] of the undeformed solid at the reference temperature."""
        return float(np.sqrt(plastic_evaluation.pressure_wave_modulus(self.law) / self.law.density))

    def take_energies(self) -> dict[str, float]:
        """Plastic work, what of it back stresses store, viscous heat and what failure released [J], all in stored
        energies, since this was asked."""
        result = {"plastic_work": self.plastic_work, "viscous_heat": self.viscous_heat}
        if self.law.kinematic_hardening is not None:
            result[plastic_fields.BACK_STRESS_ENERGY] = self.stored
        if self.law.failure is not None:
            result[FAILURE_DISSIPATION] = self.released
        self.plastic_work = self.viscous_heat = self.released = self.stored = 0.0
        return result
