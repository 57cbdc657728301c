"""Updated-Lagrangian SPH: neighbours in present places, a leapfrog with two sweeps a step (docs/ulsph.md)."""

from contextlib import nullcontext
from typing import Any

import numpy as np

from parsolid.boundary.conditions import Conditions
from parsolid.collective import anywhere, maximum
from parsolid.kernels import kernel
from parsolid.materials.blocks import block_numbers
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.micro_inertia import MicroInertia
from parsolid.materials.registry import laws_of
from parsolid.methods import failed_matter, previous_state
from parsolid.methods.hyperelastic_particles import declare_deformation
from parsolid.methods.leapfrog import drift
from parsolid.methods.protocol import Announce, EnergyLedger
from parsolid.methods.ulsph.deletion import Deletion
from parsolid.methods.ulsph.elastic_plastic import ElasticPlasticSolid
from parsolid.methods.ulsph.heat import Temperatures
from parsolid.methods.ulsph.hyperelastic import HyperelasticSolid
from parsolid.methods.ulsph.kicks import Kicks
from parsolid.methods.ulsph.micro_inertia import MicroInertiaSolid
from parsolid.methods.ulsph.neighbours import Neighbours
from parsolid.methods.ulsph.output import Reports
from parsolid.methods.ulsph.state import declare_motion, declare_particles, declare_state
from parsolid.methods.ulsph.sweeps import ArtificialViscosity
from parsolid.pairs.smoothing import smoothing_kernel
from parsolid.pairs.verlet_list import VerletList
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns
from parsolid.particles.generated import declare_generated
from parsolid.particles.initial_fields import (
    initial_displacement,
    initial_micro_rate,
    initial_plastic_strain,
    initial_temperature,
    initial_velocity,
)
from parsolid.particles.law_values import declare_law_values
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import selected
from parsolid.per_rank import PerRank, own_share
from parsolid.scene import Scene
from parsolid.scene.boundaries import MicroHard

# norm of the correction of gradients above which it is scaled down: 10 fails at 600 m/s
_MOST_CORRECTION = 6.0
_SOLIDS: dict[type, Any] = {MicroInertia: MicroInertiaSolid, ElasticPlastic: ElasticPlasticSolid}


@kernel
def least_transit(n, velocity, sound_speed, smoothing_length):
    """The least h / (c + |v|) [s] of n particles."""
    least = np.inf
    for a in range(n):
        square = 0.0
        for c in range(velocity.shape[0]):
            square += velocity[c, a] * velocity[c, a]
        transit = smoothing_length[0, a] / (sound_speed[0, a] + square**0.5)
        # what is not a number stays
        if transit < least or np.isnan(transit):
            least = transit
    return least


class UpdatedLagrangianSPH(Reports):
    """The method on one rank.

    solids: what the particles of each law do between the sweeps; planes: mirror planes, None where none moves;
    most_correction: bound of the correction of gradients, None without correction; centred: None unless the correction
    is carried on from the middle of the step, because contact acts at the ends of steps; in_plane: None in space.
    """

    time = 0.0
    takes_heat = True
    checkpoint: dict[str, Any] | None = None

    def __init__(self, comm: Any, scene: Scene, particle_set: ParticleSet):
        """particle_set: this rank's particles, sorted by law. Collective."""
        self.comm, self.settings, self.dimension = comm, scene.method, scene.dimension
        settings, laws = scene.method, laws_of(scene)
        self.laws, law_of_body = block_numbers(laws, np.arange(len(laws)))
        self.solids = [_SOLIDS.get(type(law), HyperelasticSolid)(law) for law in self.laws]
        self.particles = particles = Particles(particle_set.body, law_of_body)
        declare_generated(particles, particle_set, ("reference_position",), reference_position=Columns())
        declare_motion(particles, particle_set.position)
        density = np.array([law.density for law in self.laws])[law_of_body[particle_set.body]]
        length = settings.smoothing * np.prod(particle_set.spacing, axis=1) ** (1.0 / self.dimension)
        declare_particles(particles, density * particle_set.volume, length)
        self.conditions = Conditions(comm, scene, particle_set, particles)
        self.kicks = Kicks(self)
        self.reactions, self.stop_times = self.conditions.reactions, self.conditions.times
        elastic = [solid for solid in self.solids if isinstance(solid, HyperelasticSolid)]
        if elastic:
            declare_deformation(particles, self.dimension, self.laws)
            declare_law_values(comm, scene, particles, particle_set, laws)
        for solid in elastic:
            solid.join(particles, self.dimension, laws)
        several_bodies = maximum(comm, int(particle_set.body.max(initial=0))) > 0
        clamped = [selected(scene, one, particle_set, comm) for _, one in self.conditions.of(MicroHard)]
        free = ~np.logical_or.reduce(clamped) if clamped else None
        declare_state(particles, self.dimension, self.solids, several_bodies, free)
        failed_matter.declare_failure(particles, self.laws)
        self.temperatures = Temperatures(comm, scene, particle_set, particles, self.solids)
        self.deletion = Deletion(self) if "deleted_mass" in particles else None
        codes = self.conditions.codes
        self.planes = codes if codes is not None and codes.moving else None
        self.most_correction = _MOST_CORRECTION if settings.gradient_correction else None
        self.centred: bool | None = None
        self.in_plane = True if self.dimension == 2 else None
        given = settings.viscosity
        self.viscosity = ArtificialViscosity(given.linear, given.quadratic, given.softening) if given else None
        smoothing = smoothing_kernel(settings.kernel)
        skin = (float(settings.skin), codes, float(settings.rebalance))
        self.pairs = VerletList(comm, particles, self.dimension, smoothing.support, *skin)
        self.pairs.unbonded = scene.unbonded
        bonds = settings.contact == "welded", settings.gradient_correction
        # what micro-inertia delays may flow to warmer particles
        fourier = all(isinstance(solid, ElasticPlasticSolid) for solid in self.solids if "heat" in solid.flows)
        options = self.dimension, smoothing, self.viscosity, *bonds, fourier
        self.neighbours = Neighbours(particles, self.pairs, *options)
        self.whole_mass = float(comm.allreduce(float(self.mass.sum())))

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """See `ParticleSystem.take_heat`; no particle lies on a mirror plane."""
        return self.temperatures.take(heat, rows)

    def advance_positions(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Opening half kick, state from the rates in the middle of the step [s], and drift to its end."""
        if self.rebuild_anywhere:
            with self.deletion.announced() if self.deletion is not None else nullcontext():
                self.pairs.rebuild(time)
            self.neighbours.follow()
        if self.planes is not None:
            self.planes.drive(time, step)
        self.kicks.open_step(time, step)
        if self.deletion is not None:
            self.deletion.stop()
        if self.planes is not None:
            self.planes.travel(0.5 * step)
        self.drift(0, self.owned, 0.5 * step)
        self.find_rates(0.5 * step)
        self.material = self.advance_state(time + step, step)
        self.drift(0, self.owned + self.particles.ghosts, 0.5 * step)
        if self.planes is not None:
            self.planes.travel(0.5 * step)
        self.kicks.leapfrog.place(time + step, step)

    def complete_step(self, time: float, step: float, ledger: EnergyLedger, announce: Announce) -> bool:
        """Forces of the new state, closing half kick, fluxes of heat and micro-flux, energies."""
        sound, plastic, lost = self.material
        self.check_list(time + step, step)
        announce(sound, self.stable_step())
        self.neighbours.find_forces()
        self.kicks.close_step(time + step, step)
        self.kicks.book(step, ledger, plastic + self.advance_fluxes(step), lost)
        return sound

    def check_list(self, time: float, step: float) -> None:
        """Find whether the next step needs a new list, or particles are to be deleted."""
        due = self.deletion is not None and self.deletion.asks
        self.time, self.rebuild_needed = time, self.pairs.expires(time, self.substeps * step) or due

    def drift(self, first: int, last: int, step: float) -> None:
        """Move particles first..last-1; ghosts move as their owners do."""
        drift(first, last, step, self.particles.storage("velocity"), self.particles.storage("position"))

    def find_rates(self, drifted: float) -> None:
        """Sums of the first sweep; ghosts drift for as long [s] as their owners did before the message."""
        if self.deletion is not None:
            self.deletion.carry_out()
        owned = self.owned
        self.neighbours.find_rates(lambda: self.drift(owned, owned + self.particles.ghosts, drifted))

    def advance_state(self, time: float, step: float) -> tuple[bool, float, float]:
        """The state after a step [s] to a time [s]: whether it is sound, plastic heat and numerical loss [J]."""
        sound, plastic, lost = True, 0.0, 0.0
        for solid, here in self.parts():
            good, heat, loss = solid.advance(self, here, step)
            sound, plastic, lost = sound and good, plastic + heat, lost + loss
        self.temperatures.prescribe(time)
        return sound, plastic, lost

    def advance_fluxes(self, step: float) -> float:
        """Fluxes after a step [s] from gradients of its end; what of them is dissipated [J]."""
        return float(sum(solid.advance_fluxes(self, here, step) for solid, here in self.parts()))

    def stable_step(self) -> float:
        """Largest step [s] of this rank's particles: cfl h/(c + |v|), and what fluxes and springs allow."""
        of = self.particles.storage
        transit = least_transit(self.owned, of("velocity"), of("sound_speed"), of("smoothing_length"))
        fluxes = min((solid.stable_step(self.particles, here) for solid, here in self.parts()), default=np.inf)
        return float(min(self.settings.cfl * transit, fluxes, self.conditions.largest_step))

    # --- start and restart -------------------------------------------------------------------------------------

    def take_external_forces(self, keep_rows: bool) -> None:
        """Forces of contact do their work at the ends of steps, for which the correction is carried on."""
        super().take_external_forces(keep_rows)
        self.centred = True

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        rows, place = self.particles.owned_rows, (scene, particle_set.body, particle_set.position)
        rows("velocity")[:] = initial_velocity(*place, particle_set.regions)
        displacement = initial_displacement(*place, particle_set.regions)
        if displacement is not None:
            rows("position")[:] += displacement
        usual = [getattr(law, "reference_temperature", 0.0) for law in self.laws]
        reference = np.array(usual)[self.particles.law_of_body]
        rows("temperature")[:] = initial_temperature(*place, reference, particle_set.regions)
        rows("plastic_strain")[:] = initial_plastic_strain(*place, particle_set.regions)
        flowing = initial_micro_rate(*place)
        if flowing is not None:
            rows("micro_rate")[:] = flowing * (rows("micro_free") if "micro_free" in self.particles else 1.0)
        for solid, here in self.parts():
            solid.begin(scene, self.particles, here, particle_set)
        if previous_state.take_state(self.comm, scene, self, particle_set) and self.deletion is not None:
            self.deletion.lighten()
        self.conditions.hold(0.0)
        if self.planes is not None:
            self.planes.drive(0.0, 0.0)
        self.pairs.rebuild(0.0)
        self.neighbours.follow()
        self.find_rates(0.0)
        self.advance_state(0.0, 0.0)
        self.neighbours.find_forces()
        self.advance_fluxes(0.0)
        self.kicks.viscous_heat.continues = previous_state.take_forces(self.comm, scene, self)
        if self.kicks.viscous_heat.continues:
            # weights of pairs in tension follow the stress
            self.neighbours.follow()

    def resume(self) -> None:
        assert self.checkpoint is not None
        if self.deletion is not None:
            self.deletion.lighten()
        self.pairs.restore(self.checkpoint["pairs"], self.checkpoint["time"])
        self.neighbours.follow()

    def state(self) -> dict[str, Any]:
        """The list, whether it is used up, and viscous heat to come; collective."""
        rebuild_needed = anywhere(self.comm, self.rebuild_needed)
        heat = self.kicks.viscous_heat.state()
        kept = {"pairs": self.pairs.state(), "time": self.time, "rebuild_needed": rebuild_needed, "viscous_heat": heat}
        if self.planes is not None:
            kept["plane_forces"] = PerRank(*self.neighbours.plane_forces.ravel())
        kept["torn"] = anywhere(self.comm, self.neighbours.torn)
        return kept | {"last_step": self.kicks.leapfrog.last_step}

    def set_state(self, state: dict[str, Any]) -> None:
        self.checkpoint, self.time, self.rebuild_needed = state, state["time"], state["rebuild_needed"]
        self.kicks.leapfrog.last_step, self.neighbours.torn = state["last_step"], state["torn"]
        self.kicks.viscous_heat.set_state(self.comm, state["viscous_heat"])
        if self.planes is not None:
            forces = np.array(own_share(self.comm, state["plane_forces"]))
            self.neighbours.plane_forces = forces.reshape(-1, 2, self.dimension)
