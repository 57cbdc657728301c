"""Boundary conditions and loads of a scene on one rank's particles, the same for all particle methods.

A step of leapfrog (`methods.leapfrog.Leapfrog` makes these calls):

    conditions.begin_with_mean(t, step)           # prescribed components move with their mean velocity of the step
    external = conditions.external_force(t, force, damping)
    ...                                           # opening kick with `external` and `conditions.free`, drift
    conditions.place(t + step, step)              # prescribed displacements and rotations, exactly
    conditions.observe(step / 2)                  # works and reactions of the forces, with present x and v
    ...                                           # forces of the new state
    external = conditions.external_force(t + step, force, damping, before_jump=True)
    conditions.observe(step / 2)
    ...                                           # closing kick
    conditions.end_motion(t + step)               # prescribed velocities
    work = conditions.end_step(step, ledger)      # external work of what moves prescribed components

Stages of SSP-RK3 begin with `begin_step`, and call `external_force(time of the stage, ...)`, `observe(weight step)` and
`impose(next time)` in turn, the last one `end_motion`. A static solution calls `find_loads` and
`motion.displace(t, step, u)`. The material point method has `Loads` alone, and applies supports, prescribed motion
(`of(MotionCondition)`) and `walls.RigidWall` to nodes; it calls `find_loads`, `observe(duration, velocity)` and
`report` at the end of its step.

Vectors are arrays (d, n) with a row for each component. `external_force` and `find_loads` give forces [N] on the parts
of particles on this side of mirror planes; `force` and `damping` are those on whole particles, which `observe` reads
again. The force of contact, tools and ties is a field of the particles (`EXTERNAL_FORCE`), which integrators add;
supports and motion resist it.

A new kind is a class of its keys in `scene/boundaries.py`; if it derives from `Traction`, `Pressure` or
`MotionCondition` there, that is all. A new load is a class in `boundary.forces`; a new constraint is one in
`boundary.constraints`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.boundary.constraints import InclinedRoller, Supports, inclined_rollers, mirror_plane
from parsolid.boundary.kernels import end_motion, put, replace
from parsolid.boundary.loads import Loads, Parts
from parsolid.boundary.motion import PrescribedMotion
from parsolid.boundary.reactions import Reaction
from parsolid.collective import anywhere
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import selected
from parsolid.scene.boundaries import Condition, Support
from parsolid.scene.schema import Scene

# fields (d, n) of particles on which contact, tools or ties act: their force [N] in the present places, and impulses
# [N s] at the end of a step, on the parts of particles on this side of mirror planes
EXTERNAL_FORCE, EXTERNAL_IMPULSE = "external_force", "external_impulse"
# field (n,) of particles of half bodies: the part of a whole one that these are, where they lie on symmetry planes
HALF = "half_share"
# positions (d, n) at the start of the common step, where a system takes several steps of its own in it
COMMON_START = "common_step_start"


class Holder(NamedTuple):
    """A condition that holds components of particles and reports their force; find() gives rows (k,) and components
    (k, d); prescribes: whether the components move."""

    reaction: Reaction
    find: Callable[[], tuple[np.ndarray, np.ndarray]]
    prescribes: bool


class Prescribed(NamedTuple):
    """Prescribed components: rows (k,) and parts (p, 4), see `boundary.kernels`; start (k,): their velocities [m/s] at
    the start of the step."""

    rows: np.ndarray
    parts: np.ndarray
    start: np.ndarray


class Conditions(Loads):
    """All of a scene's boundary conditions and loads on a rank's particles, see also `Loads`.

    planes: mirror planes; ends: those of half bodies, see `Supports`; codes: every reflection of particles, None
    without planes; share (n,): the part of each particle of the set on this side of mirror planes; held (n, d) bool:
    components of the set that supports hold; motion: prescribed components; rollers: inclined ones; holders: conditions
    that hold components and report their force.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        scene: Scene,
        particle_set: ParticleSet,
        particles: Particles,
        without_images: frozenset[int] = frozenset(),
        half_bodies: frozenset[int] = frozenset(),
        others: tuple[type[Condition], ...] = (),
    ):
        """without_images, half_bodies: see `Supports`; the others: see `Loads`. Raises SolverError on all ranks.
        Collective."""
        super().__init__(comm, scene, particle_set, particles, others)
        supports = Supports(comm, scene, self.all, particle_set, without_images, half_bodies)
        self.planes, self.ends, self.codes = supports.planes, supports.ends, supports.codes
        self.share, self.held = supports.share, supports.held
        self.rollers: list[InclinedRoller] = inclined_rollers(comm, scene, supports, particle_set, particles)
        self.motion = PrescribedMotion(comm, scene, self.all, particle_set, particles)
        self.holders = self._find_holders()
        self._roller_reactions = [self.reaction_of(roller.condition) for roller in self.rollers]
        self._declare_held()
        self._layout_of_prescribed = self._layout_of_free = -1
        # of what moves prescribed components in the step [J]
        self._work = 0.0

    def _find_holders(self) -> list[Holder]:
        """Those of supports that hold components of particles, and of prescribed motion."""
        result = []
        for _, one in self.all:
            reaction = self.reaction_of(one)
            if reaction is None:
                continue
            if self.motion.prescribes(one):
                result.append(Holder(reaction, partial(self.motion.held_by, one), True))
            elif isinstance(one, Support) and (one.plane is not None or one.kind == "fixed"):
                axes = np.ones(self.dimension, bool)
                if one.plane is not None:
                    axes = mirror_plane(self.scene, one).held(self.dimension)
                selection = self.particles.selection(selected(self.scene, one, self.particle_set, self.comm))
                find = partial(self._held_by_support, selection, axes)
                result.append(Holder(reaction, find, False))
        return result

    def _held_by_support(self, selection: Any, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows and components of a support; those whose motion is prescribed are the motion's."""
        mask = np.zeros((self.particles.owned, self.dimension), bool)
        mask[selection.rows] = axes
        mask[self.motion.rows, self.motion.axes] = False
        return selection.rows, mask[selection.rows]

    def _declare_held(self) -> None:
        """The field "held_components" (d, n) travels with the particles, where there are any."""
        self._any_held = anywhere(self.comm, bool(self.held.any()))
        self._any_constrained = self._any_held or self.motion.there
        if self._any_held:
            self.particles.declare(
                Field("held_components", self.dimension, "1", mirror="vector", layout=Columns()), 1.0 * self.held
            )

    # --- what integrators ask -----------------------------------------------------------------------------------

    @property
    def free(self) -> np.ndarray | None:
        """Factors (d, owned) int8 of accelerations: 0 where a component is held or prescribed, else 1; None where none
        is on any rank."""
        if not self._any_constrained:
            return None
        if self._layout_of_free != self.particles.layout:
            self._layout_of_free = self.particles.layout
            self._free = np.ones((self.dimension, self.particles.owned), np.int8)
            if self._any_held:
                self._free[self._held_now()] = 0
            self._free[self.motion.axes, self.motion.rows] = 0
        return self._free

    def _held_now(self) -> np.ndarray:
        """Components (d, owned) bool that supports hold."""
        return np.asarray(self.particles.owned_rows("held_components").reshape(-1, self.dimension).T > 0.0)

    @property
    def constrained(self) -> np.ndarray | None:
        """Components (owned, d) bool that are held or prescribed, None where this rank has none."""
        free = self.free
        return None if free is None or free.all() else free.T == 0

    def hold(self, time: float) -> None:
        """Give velocities and prescribed displacements of a state the values that they have at a time [s]."""
        velocity = self._velocity()
        if self._any_held:
            velocity[self._held_now()] = 0.0
        for roller in self.rollers:
            velocity[:, roller.rows] -= roller.held(velocity[:, roller.rows])
        if self.motion.there:
            self.motion.place(time, False, self._displacement())
            self._put_velocities(self.motion.end_velocities(time, np.zeros(len(self.motion.rows))))

    @property
    def prescribed(self) -> Prescribed:
        """What is prescribed of this rank's particles."""
        if self._layout_of_prescribed != self.particles.layout:
            self._layout_of_prescribed = self.particles.layout
            rows = self.motion.rows
            self._prescribed = Prescribed(rows, self.motion.parts(self.number_of), np.zeros(len(rows)))
        return self._prescribed

    def _held_parts(self) -> tuple[Parts, Parts]:
        """Of prescribed components, and of those that supports hold that report their force."""
        rows, parts, _ = self.prescribed
        moving: Parts = [(axis, number, rows[first:last]) for first, last, axis, number in parts.tolist()]
        held: Parts = []
        for holder in self.holders:
            if not holder.prescribes:
                (among, components), number = holder.find(), self.number_of(holder.reaction.condition)
                held += [(axis, number, among[components[:, axis]]) for axis in range(self.dimension)]
        return moving, held

    def begin_step(self) -> None:
        """Keep what the energies of a step need of its start."""
        self._work = 0.0
        if self.motion.there:
            self.prescribed.start[:] = self._velocity()[self.motion.axes, self.motion.rows]

    def begin_with_mean(self, time: float, step: float) -> None:
        """`begin_step`, and let prescribed components have their mean velocity of a step [s] from a time [s]."""
        self._work = 0.0
        if self.motion.there:
            (rows, parts, start), mean = self.prescribed, self.motion.mean_velocity(time, step, self._displacement())
            replace(rows, parts, mean, self.particles.storage("velocity"), start)

    def _put_velocities(self, values: np.ndarray) -> None:
        """Give prescribed components velocities (k,) [m/s]."""
        rows, parts, _ = self.prescribed
        put(rows, parts, values, self.particles.storage("velocity"))

    def place(self, time: float, step: float) -> None:
        """Put what is prescribed exactly where it is at the end of a step [s] at a time [s], after a drift."""
        if self.motion.there:
            self.motion.place(time, step > 0.0, self._displacement())

    def impose(self, time: float, before_jump: bool = False) -> None:
        """Give prescribed components their velocity at a time [s], at a jump before or after it."""
        if self.motion.there:
            at = self.motion.axes, self.motion.rows
            mean = None if self.motion.all_velocities else self._velocity()[at]
            self._put_velocities(self.motion.end_velocities(time, mean, before_jump))

    def external_force(
        self, time: float, force: np.ndarray, damping: np.ndarray | None = None, before_jump: bool = False
    ) -> np.ndarray | None:
        """Loads of a time [s] and what holds the particles of inclined rollers, (d, owned) [N]; None without any.

        force, damping (d, owned or more) [N]: internal and dissipative forces on whole particles at that time.
        """
        external = self.find_loads(time, before_jump)
        if self.rollers:
            external = np.zeros((self.dimension, self.particles.owned)) if external is None else external.copy()
            self._hold_rollers(force, damping, external)
        self._forces = force, damping, external
        return external

    def _hold_rollers(self, force: np.ndarray, damping: np.ndarray | None, external: np.ndarray) -> None:
        """Add what holds particles of inclined rollers to forces (d, owned) [N]."""
        share, interaction = self._parts_and_interaction()
        for roller, reaction in zip(self.rollers, self._roller_reactions):
            rows = roller.rows
            acting = force[:, rows] if damping is None else force[:, rows] + damping[:, rows]
            acting = acting if share is None else share[rows] * acting
            acting = acting + external[:, rows] + (0.0 if interaction is None else interaction[:, rows])
            held = -roller.held(acting)
            external[:, rows] += held
            if reaction is not None:
                self._reported.append((self.number_of(roller.condition), rows, held))

    def _acting(self) -> Any:
        force, damping, external = self._forces
        return force, damping, *self._parts_and_interaction(), external

    def _parts_and_interaction(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        """The part (owned,) of particles on this side of mirror planes, and forces (d, capacity) [N] of contact, tools
        and ties; None without."""
        return self.particles.kept(("parts and interaction", self), self._find_parts_and_interaction)

    def _find_parts_and_interaction(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        particles = self.particles
        share = particles.owned_rows("share") if "share" in particles else None
        return share, particles.storage(EXTERNAL_FORCE) if EXTERNAL_FORCE in particles else None

    def observe(self, duration: float, velocity: np.ndarray | None = None) -> float:
        """See `Loads.observe`; of what holds components, too, against the forces of the last `external_force`."""
        work = super().observe(duration, velocity)
        self._work += work
        return work

    def end_motion(self, time: float) -> None:
        """`impose`, at the end of a step."""
        if self.motion.there:
            (rows, parts, start), of, velocity = self.prescribed, self.particles.owned_rows, self._velocity()
            mean = None if self.motion.all_velocities else velocity[self.motion.axes, self.motion.rows]
            share, _ = self._parts_and_interaction()
            state = self.motion.end_velocities(time, mean), start, velocity, of("mass")
            self._work += end_motion(rows, parts, *state, share, of("position").T, self._about, self._sums)

    def end_step(self, step: float, ledger: Any) -> float:
        """External work [J] of what has moved prescribed components in a step [s]; reactions go to the ledger."""
        self.report(step, ledger)
        return self._work

    def _displacement(self) -> np.ndarray | None:
        """Displacements (d, owned), a view, of a method that keeps them."""
        return self.particles.owned_rows("displacement").T if "displacement" in self.particles else None
