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
from parsolid.materials.plastic import tile_update as update
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.methods import plastic_fields
from parsolid.methods.failure_fields import FAILURE_DISSIPATION
from parsolid.methods.ulsph import kinematics
from parsolid.methods.ulsph.heat import advance_heat_flux
from parsolid.particles.container import Particles
from parsolid.particles.initial_fields import initial_zero_energy_temperature
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene
from parsolid.tiles import TILE, load_rows, store_rows


class State(NamedTuple):
    """Fields (components, particles), see `state`; the last two are None where the law has none."""

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
def advance_density(density, reference, first, count, gradients, tile):
    """Densities after a step; JACOBIAN, MIDDLE_JACOBIAN and NEW_JACOBIAN."""
    for p in range(count):
        a = first + p
        J, growth = reference / density[0, a], gradients[kinematics.GROWTH * TILE + p]
        tile[update.JACOBIAN * TILE + p] = J
        tile[update.MIDDLE_JACOBIAN * TILE + p] = J / growth
        tile[update.NEW_JACOBIAN * TILE + p] = J / (growth * growth)
        density[0, a] *= growth * growth


@inlined
def viscous_losses(step, mean_step, mass, force, viscous_force, heat, impulse_power, external, first, count, tile):
    """HEAT [J] of the artificial viscosity: what its forces V take in both half kicks around their time, the second
    half of the step before and the first half of this one, together mean_step [s].

    The sums q = -V.v are of velocities v half a step before these kicks, d and d' long, which change v by d F/2m and
    d' F/2m with all forces F. So -V.dv of both is h q - h^2 V.F/2m with h = (d + d')/2, also where d is 0. Impulses of
    contact between the kicks change v by dv; w = V.dv belongs to the second kick alone. external: forces of contact, or
    None.
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
        tile[update.HEAT * TILE + p] = mean_step * loss - 0.5 * step * impulse_power[0, a]


@kernel
def advance_state(
    first, last, law, failure, step, mean_step, most, centred, in_plane, rates, flows, state, viscosity, external,
    failing, strength, deleted, tile,
):  # fmt: skip
    """State of particles first..last-1 after a step [s] from the sums of the first sweep.

    most, in_plane: see `kinematics.find_gradients`; centred: None unless B is carried on from the middle of the step;
    flows: of heat, or None; viscosity: force, viscous_force, viscous_heat and impulse_power, or None; external: forces
    of contact, or None; failing: damage and criterion_damage, or None; strength: its factors, or None; deleted: masses,
    or None; tile: of `tile_update`. Returns whether no particle is compressed beyond its equation of state and all
    numbers are finite, then plastic work, viscous heat, energy released by failure, and the part of the plastic work
    that back stresses store [J].
    """
    sound, plastic, viscous, released, stored = True, 0.0, 0.0, 0.0, 0.0
    gradients, numbers = np.zeros(kinematics.ROWS * TILE), (state.plastic_strain, state.energy, state.temperature)
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        kinematics.load_rates(rates, state.mass, state.density, in_plane, deleted, i, count, gradients)
        load_rows(state.correction, i, count, gradients, kinematics.LAST)
        load_rows(state.deviator, i, count, tile, update.DEVIATOR)
        update.load_state(numbers, failing, strength, i, count, tile)
        update.load_if_any(state.back_stress, i, count, tile, update.BACK_STRESS)
        update.load_if_any(state.volume_flow, i, count, tile, update.PLASTIC_VOLUME)
        update.fill_idle(law, tile, count)
        kinematics.find_gradients(step, most, in_plane, gradients)
        kinematics.carry_on_correction(0.5 * step if centred is not None else 0.0, mean_step, gradients)
        kinematics.turn_deviator(step, gradients, state.back_stress, tile)
        advance_density(state.density, law.density, i, count, gradients, tile)
        update.start_step(law, failure, tile)
        tile[update.HEAT * TILE : (update.HEAT + 1) * TILE] = 0.0
        if viscosity is not None:
            viscous_losses(step, mean_step, state.mass, *viscosity, external, i, count, tile)
        for p in range(count):
            per_volume = law.density / state.mass[0, i + p]
            if deleted is None or deleted[0, i + p] <= 0.0:
                viscous += tile[update.HEAT * TILE + p]
            if flows is not None:
                tile[update.HEAT * TILE + p] -= step * flows[i + p, 1]
            tile[update.HEAT * TILE + p] *= per_volume
        update.flow(law, failure, step, tile)
        update.finish_step(law, failure, step, tile)
        store_rows(state.deviator, i, count, tile, update.DEVIATOR)
        update.store_state(numbers, failing, i, count, tile)
        update.store_if_any(state.back_stress, i, count, tile, update.BACK_STRESS)
        update.store_if_any(state.volume_flow, i, count, tile, update.PLASTIC_VOLUME)
        store_rows(state.sound_speed, i, count, tile, update.SPEED)
        store_rows(state.correction, i, count, gradients, kinematics.CORRECTION)
        kinematics.store_pair_stress(
            tile, update.PRESSURE, gradients, kinematics.CARRIED, state.density, in_plane, i, count, state.pair_stress
        )
        for p in range(count):
            volume = state.mass[0, i + p] / law.density
            if deleted is None or deleted[0, i + p] <= 0.0:
                plastic += volume * tile[update.PLASTIC_WORK * TILE + p]
                stored += volume * tile[update.BACK_STRESS_ENERGY * TILE + p]
                released += volume * tile[update.RELEASED * TILE + p]
                sound = sound and tile[update.ROOM * TILE + p] > 0.0
    return sound, plastic, viscous, released, stored


class ElasticPlasticSolid:
    """Particles of one elastic-plastic law on a rank.

    stores_heat: whether stored energies hold heat, that of the viscosity included; speeds_change: whether speeds of
    sound follow the state.
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
        self._tile = update.new_tile(count_of(law.failure))
        # of all steps since `take_energies` [J]: plastic work, viscous heat, released by failure, stored by back stress
        self._energies = np.zeros(4)

    def begin(self, scene: Scene, particles: Particles, here: slice, particle_set: ParticleSet) -> None:
        """The internal energy that belongs to the temperatures at time 0."""
        of = particles.owned_rows
        warm = of("temperature")[here]
        cold = initial_zero_energy_temperature(scene, of("body")[here], warm, self.law.reference_temperature)
        of("energy")[here] = self.law.internal_energy(warm, cold)

    def advance(self, system: Any, here: slice, step: float) -> tuple[bool, float, float]:
        """The state after a step [s] from the sums of the first sweep: whether it is sound; plastic heat and numerical
        loss [J] outside of stored energies, both 0."""
        particles, law, sums = system.particles, self.law, system.neighbours
        of = particles.storage
        state = State._make([*map(of, State._fields[:-2]), *plastic_fields.flow_state(particles, law)])
        viscosity = failing = strength = deleted = None
        external = of(EXTERNAL_FORCE) if EXTERNAL_FORCE in particles else None
        if system.viscosity is not None:
            viscosity = of("force"), of("viscous_force"), of("viscous_heat"), of("impulse_power")
        if law.failure is not None:
            failing = of("damage"), of("criterion_damage")[: count_of(law.failure)]
            strength = of("strength_factor") if "strength_factor" in particles else None
            deleted = of("deleted_mass") if "deleted_mass" in particles else None
        flows = sums.flows if "heat" in self.flows else None
        mean_step = system.kicks.viscous_heat.mean_step(step)
        options = system.most_correction, system.centred, system.in_plane
        sound, *energies = advance_state(
            here.start, here.stop, law, law.failure, step, mean_step, *options, sums.rates, flows,
            state, viscosity, external, failing, strength, deleted, self._tile,
        )  # fmt: skip
        self._energies += energies
        return sound, 0.0, 0.0

    def advance_fluxes(self, system: Any, here: slice, step: float) -> float:
        """The heat flux from the sums of the second sweep; 0, as nothing is dissipated outside of stored energies."""
        if "heat" in self.flows:
            of = system.particles.storage
            fields = (of(name) for name in ("mass", "density", "correction", "heat_flux", "pair_heat_flux"))
            slopes, stride = system.neighbours.slopes, system.neighbours.stride
            advance_heat_flux(here.start, here.stop, self.law.conductivity, system.in_plane, stride, slopes, *fields)
        return 0.0

    def energies(self, particles: Particles, here: slice) -> tuple[float, float]:
        """Kinetic energy besides that of the velocity, 0, and internal energy [J]."""
        of = particles.owned_rows
        return 0.0, float(of("energy")[here] @ of("mass")[here]) / self.law.density

    def stable_step(self, particles: Particles, here: slice) -> float:
        """rho C_v h^2/(6 kappa) [s] of conduction by Fourier, a third of what is stable: in longer steps particles pass
        their neighbours' temperatures. Infinite without it."""
        if not self.law.conductivity:
            return float(np.inf)
        of = particles.owned_rows
        capacity = self.law.specific_heat_at(of("temperature")[here]) * of("density")[here]
        return float((capacity * of("smoothing_length")[here] ** 2).min() / (6.0 * self.law.conductivity))

    def pressures(self, particles: Particles, here: slice) -> np.ndarray:
        """P (n,) [Pa]."""
        of = particles.owned_rows
        volume = of(plastic_fields.VOLUME_FLOW)[here, 0] if plastic_fields.flows_in_volume(self.law) else 0.0
        return plastic_evaluation.pressure(self.law, self.law.density / of("density")[here], of("energy")[here], volume)

    def room(self, particles: Particles, here: slice) -> np.ndarray | None:
        """How far each particle (n,) may still be compressed, see `room_to_compress`."""
        return plastic_evaluation.room_to_compress(self.law, self.law.density / particles.owned_rows("density")[here])

    @property
    def sound_speed(self) -> float:
        """c_L [m/s] of the undeformed solid at the reference temperature."""
        return float(np.sqrt(plastic_evaluation.pressure_wave_modulus(self.law) / self.law.density))

    def take_energies(self) -> dict[str, float]:
        """Plastic work, viscous heat, what failure released and what back stresses store [J] since the last call, all
        of them part of stored energies."""
        plastic, viscous, released, stored = map(float, self._energies)
        self._energies[:] = 0.0
        result = {"plastic_work": plastic, "viscous_heat": viscous}
        if self.law.kinematic_hardening is not None:
            result[plastic_fields.BACK_STRESS_ENERGY] = stored
        if self.law.failure is not None:
            result[FAILURE_DISSIPATION] = released
        return result
