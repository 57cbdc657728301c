"""Updated-Lagrangian SPH: neighbours of the present configuration, a leapfrog of two passes (docs/microinertia.md)."""

from contextlib import nullcontext
from typing import Any

import numpy as np

from decomposition.measured_load import MeasuredLoad
from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import anywhere, maximum, minimum
from parsolid.materials.blocks import MaterialBlock, block_numbers, blocks_between
from parsolid.materials.registry import laws_of
from parsolid.methods import failed_matter, previous_state
from parsolid.methods.pair_method import PairMethod
from parsolid.methods.protocol import Announce, EnergyLedger
from parsolid.methods.ulsph import kinematics as motion
from parsolid.methods.ulsph.boundaries import BoundarySet
from parsolid.methods.ulsph.deletion import Deletion
from parsolid.methods.ulsph.fields import declare_motion, declare_state
from parsolid.methods.ulsph.heat import HalfSteps, follow_kick, heat_to_come, prescribe_temperatures, take_heat
from parsolid.methods.ulsph.observation import advice, measure, shown, unsound
from parsolid.methods.ulsph.sweeps import Sweeps
from parsolid.methods.ulsph.terms import (
    CentredCorrection,
    CompressionOnly,
    GradientCorrection,
    Warming,
    Welded,
    viscosity_of,
)
from parsolid.methods.ulsph.updates import Updates, density_of
from parsolid.numerics.layout import LAYOUT
from parsolid.pairs.moving_pairs import MovingPairs
from parsolid.pairs.smoothing import smoothing_kernel
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.generated import declare_generated
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import (
    Scene,
    initial_displacement,
    initial_micro_rate,
    initial_plastic_strain,
    initial_temperature,
    initial_velocity,
)

# norm of the inverse of a moment above which it is scaled down, see `layout.bounded_inverse`: 10 fails at 600 m/s
_MOST = 6.0


class UpdatedLagrangianSPH(PairMethod):
    """The method on one rank; arrays as `terms` and `fields` say.

    correction: `terms.GradientCorrection` or `CentredCorrection`, or None for plain gradients; heating: `terms.Warming`
    where viscous heat warms, else None.
    """

    pairs: MovingPairs
    time = supplied = supplied_to_stored = 0.0
    # whether the sums of forces have the external ones
    pulled = False
    takes_heat = True

    def __init__(self, comm: Any, scene: Scene, particle_set: ParticleSet):
        """particle_set: this rank's particles, sorted by law. Collective."""
        self.comm, self.settings, self.dimension = comm, scene.method, scene.dimension
        settings, laws = scene.method, laws_of(scene)
        self.space, kernel = LAYOUT[self.dimension], smoothing_kernel(settings.kernel)
        self.laws, law_of_body = block_numbers(laws, np.arange(len(laws)))
        self.particles = particles = Particles(particle_set.body, law_of_body)
        declare_generated(particles, particle_set)
        self.updates = Updates(self, self.laws)
        self.carried = self.updates.carried
        warms = settings.viscous_heating or any(self.updates.storing)
        self.heating, self.halves = Warming() if warms and settings.viscosity else None, HalfSteps()
        declare_motion(particles, particle_set.position, self.carried, self.heating, self.updates.speeds_change)
        density = density_of(self.laws, law_of_body, particle_set.body)
        self.boundaries = BoundarySet(comm, scene, particle_set, particles)
        self.told, self.landings = self.boundaries.told, self.boundaries.surface_loads.landings
        lacks = self.updates.lacks | ({"micro_free"} if self.boundaries.held_micro is None else set())
        declare_state(particles, self.dimension, density, lacks)
        failed_matter.declare_failure(particles, self.laws)
        self._declare_constants(comm, particle_set, density)
        self.correction: Any = GradientCorrection(_MOST) if settings.gradient_correction else None
        skin = (float(settings.skin), self.boundaries.codes, float(settings.rebalance))
        self.pairs = MovingPairs(comm, particles, self.space, kernel.support, *skin)
        self.pairs.unbonded = scene.unbonded
        terms = (self.carried, viscosity_of(settings), self.heating, *self._meeting_and_length(comm, particle_set))
        self.sweeps = Sweeps(self.space, kernel, self.pairs, particles, *terms)
        self.lists_state: dict[str, Any] | None = None
        self.deletion = Deletion(self) if "deleted_mass" in particles else None

    def _declare_constants(self, comm: Any, particle_set: ParticleSet, density: np.ndarray) -> None:
        """Mass, smoothing length and, where bodies meet, the number of the body, known to ghosts."""
        particles, settings, d = self.particles, self.settings, self.dimension
        told: dict[str, Any] = {"ghosts": "forward", "message": "reference", "layout": Columns()}
        length = settings.smoothing * np.prod(particle_set.spacing, axis=1) ** (1.0 / d)
        particles.declare(Field("mass", 1, "kg", padding=(1.0,), **told), density * particle_set.volume)
        particles.declare(Field("smoothing_length", 1, "m", padding=(1.0,), **told), length)
        speeds = np.array([self.updates.of_kind[type(law)].sound_speed(law) for law in self.laws])
        particles.owned_rows("sound_speed")[:] = speeds[particles.law_of_body[particle_set.body]]
        if self.boundaries.held_micro is not None:
            particles.owned_rows("micro_free")[:] = ~self.boundaries.held_micro
        self.whole_mass = float(comm.allreduce(float(self.mass[: self.owned].sum())))

    def _meeting_and_length(self, comm: Any, particle_set: ParticleSet) -> tuple[Any, float | None]:
        """How bodies meet, None of one body; the smoothing length [m] of all particles, None where it differs."""
        contact: Any = None
        if maximum(comm, int(particle_set.body.max(initial=0))) > 0:
            contact = Welded() if self.settings.contact == "welded" else CompressionOnly()
            told: dict[str, Any] = {"ghosts": "forward", "message": "reference", "layout": Columns()}
            self.particles.declare(Field("contact_body", 1, "1", **told), particle_set.body.astype(float))
        length = self.particles.owned_rows("smoothing_length")
        least, most = minimum(comm, float(length.min(initial=np.inf))), maximum(comm, float(length.max(initial=0.0)))
        return contact, least if most - least <= 1e-9 * most else None

    def follow_work(self, work: list[float], number: int) -> None:
        """Particles are dealt out by what steps cost, where the scene asks for it."""
        if self.settings.balance == "measured":
            self.pairs.load = MeasuredLoad(self.comm, work, number)

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """Set the state at time 0 by the bodies' formulas; collective."""
        rows, place = self.particles.owned_rows, (scene, particle_set.body, particle_set.position)
        rows("velocity")[:] = initial_velocity(*place, particle_set.regions)
        displacement = initial_displacement(*place, particle_set.regions)
        if displacement is not None:
            rows("position")[:] += displacement
        usual = np.array([law.reference_temperature for law in self.laws])[self.particles.law_of_body]
        rows("temperature")[:] = initial_temperature(*place, usual, particle_set.regions)
        rows("plastic_strain")[:] = initial_plastic_strain(*place, particle_set.regions)
        flowing = initial_micro_rate(*place)
        if flowing is not None:
            held = self.boundaries.held_micro
            rows("micro_rate")[:] = flowing if held is None else np.where(held, 0.0, flowing)
        for update, block, body in self.updates.each():
            update.begin(scene, block, body)
        if previous_state.take_state(self.comm, scene, self, particle_set) and self.deletion is not None:
            self.deletion.lighten()
        self.boundaries.hold_motion(0.0)
        self.pairs.rebuild(0.0)
        self.tell_all()
        self.first_pass(0.0)
        self.advance_state(0.0, 0.0)
        self.sweeps.forces()
        self.advance_gradients(0.0)
        self.halves.goes_on = self.pulled = previous_state.take_forces(self.comm, scene, self)

    def resume(self) -> None:
        """Continue with the lists of the checkpoint; collective."""
        assert self.lists_state is not None
        if self.deletion is not None:
            self.deletion.lighten()
        self.pairs.restore(self.lists_state["pairs"], self.lists_state["time"])
        self.tell_all()

    def state(self) -> dict[str, Any]:
        """The lists, and whether they are used up; collective."""
        lists = {"pairs": self.pairs.state(), "time": self.time, "news": anywhere(self.comm, self.news)}
        return lists | {"halves": self.halves.state(self.comm), "pulled": self.pulled}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        self.lists_state, self.time, self.news = state, state["time"], state["news"]
        self.pulled = state["pulled"]
        if "halves" in state:  # an earlier version has none, and other terms in its ledger, which are refused next
            self.halves.set_state(self.comm, state["halves"])

    # --- a step -------------------------------------------------------------------------------------------------

    def _pull(self, sign: float) -> None:
        """Add external forces to the sums of the second pass."""
        if "external_force" in self.particles:
            force = self.particles.owned_rows("force_sums")
            force[:, : self.dimension] += sign * self.particles.owned_rows("external_force")

    def advance_positions(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Kick, drift, first pass, state, drift."""
        self.follow_lists(time)
        if not self.pulled:
            self._pull(1.0)
        first = self.boundaries.half_kick(time, step, time + 0.5 * step)
        self.drift(0, self.owned, 0.5 * step)
        self.first_pass(0.5 * step)
        sound, plastic, lost = self.advance_state(time + step, step)
        self.drift(0, self.owned + self.particles.ghosts, 0.5 * step)
        self.opening = first, sound, plastic, lost

    def complete_step(self, time: float, step: float, ledger: EnergyLedger, announce: Announce) -> bool:
        """Second pass, kick."""
        first, sound, plastic, lost = self.opening
        self.look_ahead(time + step, step)
        announce(sound, self.stable_step())
        self.sweeps.forces()
        impulse = self.impulse_at_end(step)
        self._pull(1.0)
        self.pulled = True
        second = self.boundaries.half_kick(time + step, step, time + step)
        plastic += self.advance_gradients(step)
        self.book(ledger, step, (plastic, lost), (first, second))
        if impulse is not None:
            before = self.particles.owned_rows("velocity").copy()
            ledger.add(1.0, 0.0, -impulse.act(self.held_components()), 0.0)
            if self.heating is not None:
                follow_kick(self, before, np.arange(self.owned))
        return sound

    def follow_lists(self, time: float) -> None:
        """Make the lists anew where a rank has found them used up; collective then."""
        if self.news_anywhere:
            with self.deletion or nullcontext():
                self.pairs.rebuild(time)
            self.tell_all()

    def tell_all(self) -> None:
        """What ghosts know besides what every step tells them, after lists were made."""
        self.sweeps.follow()
        self.particles.update("sound")
        self.particles.update("record")

    def look_ahead(self, time: float, step: float) -> None:
        """Whether the lists will be used up by the next step."""
        failed = self.deletion is not None and self.deletion.due()
        self.time, self.news = time, bool(self.pairs.due(time, self.substeps * step)) or failed

    def drift(self, first: int, last: int, step: float) -> None:
        """Move particles first..last-1."""
        motion.drift(first, last, self.dimension, step, self.particles.storage("kinematics"))

    def first_pass(self, drift: float) -> None:
        """Velocity gradients, moments and divergences; ghosts drift as their owners did before the message."""
        if self.deletion is not None:
            self.deletion.carry_out()
        owned = self.owned
        self.sweeps.rates(lambda: self.drift(owned, owned + self.particles.ghosts, drift))

    def book(
        self, ledger: EnergyLedger, step: float, state: tuple[float, float], kicks: tuple[tuple[float, ...], ...]
    ) -> None:
        """What a step [s] did: plastic heat and numerical loss of the state; of both kicks the work of loads and
        supports, what the viscosity took, and leapfrog's oscillation [J].
        """
        (plastic, lost), (first, second), viscous = state, kicks, kicks[0][1] + kicks[1][1]
        if any(self.updates.storing):
            # what laws store heats them; the others' share is lost
            viscous = self.viscous_heat_of_others(step)
        pushed, caught = self.boundaries.taken(step, ledger)
        ledger.add(1.0, plastic, lost + caught, float(first[0] + second[0]) + pushed)
        ledger.add_term("viscous_dissipation", float(viscous))
        if self.heating is not None:
            ledger.add_term("viscous_heat_to_come", self.halves.follow(heat_to_come(self, step, second[1])))
        self.halves.step, self.halves.goes_on = step, self.halves.goes_on and step == 0.0
        ledger.add_term("kinetic_offset", second[2] - first[2])
        terms = {"heat_supplied": self.supplied, "heat_stored": self.supplied_to_stored} | self.updates.taken()
        for name, energy in (terms | (self.deletion.taken() if self.deletion else {})).items():
            ledger.add_term(name, energy)

    def advance_state(self, time: float, step: float) -> tuple[bool, float, float]:
        """State and records after a step [s] to a time [s]; sound, plastic heat and numerical loss [J]."""
        sound, plastic, lost = True, 0.0, 0.0
        for update, block, body in self.updates.each():
            good, heat, loss = update.advance(block, step, body)
            sound, plastic, lost = sound and good, plastic + heat, lost + loss
        if self.boundaries.sets_temperature:
            self.supplied, self.supplied_to_stored = prescribe_temperatures(self, time)
        return sound, plastic, lost

    def take_external_forces(self, keep_rows: bool) -> None:
        """See `CentredCorrection`: what acts in a step besides does its work at its ends."""
        super().take_external_forces(keep_rows)
        self.correction = self.correction and CentredCorrection(_MOST)

    def take_heat(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """See `ParticleSystem.take_heat`; no particle lies on a mirror plane."""
        return take_heat(self, heat, rows)

    def viscous_heat_of_others(self, step: float) -> float:
        """Viscous heat [J] of a step [s] in particles whose stored energy holds no heat."""
        sums = self.particles.storage("force_sums")
        column = sums.shape[1] - 4 if self.dimension == 2 else 3
        blocks = (b for update, b, _ in self.updates.each() if self.heating is not None and not update.stores_heat)
        return step * sum((float(sums[b.first : b.last, column].sum()) for b in blocks), 0.0)

    def advance_gradients(self, step: float) -> float:
        """Fluxes after a step [s], where something flows; what of them is dissipated [J]."""
        if self.carried is None and self.heating is None:
            return 0.0
        return sum((update.advance_gradients(block, step, body) for update, block, body in self.updates.each()), 0.0)

    def stable_step(self) -> float:
        """Largest step [s] of this rank's particles: cfl h/(c + |v|), and what fluxes allow."""
        arrays = (self.particles.storage("kinematics"), self.particles["sound_speed"])
        transit = motion.least_transit(self.owned, self.dimension, *arrays, self.particles.storage("smoothing_length"))
        fluxes = min((update.stable_step(block, body) for update, block, body in self.updates.each()), default=np.inf)
        return float(min(self.settings.cfl * transit, fluxes, self.boundaries.surface_loads.largest_step))

    @property
    def placements(self) -> int:  # type: ignore[override]
        """Particles change their places when lists are made."""
        return self.pairs.rebuilds

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        """Rollers."""
        return symmetry_planes(self.boundaries.planes)

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """By the speed of sound."""
        law = self.laws[self.particles.law_of_body[body]]
        return law.density * self.updates.of_kind[type(law)].sound_speed(law) ** 2, law.density

    def held_components(self) -> np.ndarray | None:
        """Those of supports and of prescribed velocities."""
        return self.boundaries.not_free.mask(self.dimension)

    def energies(self) -> tuple[float, float]:
        """Kinetic energy, that of the micro-velocity in it, and stored energy [J] of this rank's particles."""
        arrays = (self.particles.storage("kinematics"), self.particles.storage("mass"))
        kinetic, stored = float(motion.kinetic_energy(self.owned, self.dimension, *arrays)), 0.0
        for update, block, body in self.updates.each():
            micro, elastic = update.energies(block, body)
            kinetic, stored = kinetic + micro, stored + elastic
        return kinetic, stored

    # --- what the output and the reports ask --------------------------------------------------------------------

    @property
    def owned(self) -> int:  # type: ignore[override]
        """Number of this rank's particles, which changes as they move."""
        return self.particles.owned

    @property
    def blocks(self) -> list[MaterialBlock]:
        """Particles that share a law, law after law."""
        return blocks_between(self.particles.bounds, self.laws)

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Cauchy stress (n, 3, 3) [Pa], Jacobian (n,)."""
        return shown(self, name, first, last)

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """This rank's part of one of the settings' quantities."""
        return measure(self, name)

    def unsound(self) -> tuple[int, str] | None:
        """The rank's first particle that is not sound, and what is wrong with it."""
        return unsound(self)

    def advice(self) -> str:
        """What most likely helps."""
        return advice(self.settings)

    def bytes_a_step(self) -> int:
        """Two messages a step; particles that change their rank come on top."""
        return self.particles.bytes_sent("motion") + self.particles.bytes_sent("record")

    def summary(self) -> dict[str, Any]:
        """How often lists were made anew, how often too late, and particles that changed their rank."""
        return failed_matter.summary(self.comm, self.particles, self.mass[: self.owned]) | self.pairs.summary()

    @staticmethod
    def small_scene(tables: dict[str, Any]) -> dict[str, Any]:
        """Particles in the middles of cells."""
        tables["bodies"] = [body | {"placement": "cells"} for body in tables["bodies"]]
        return tables
