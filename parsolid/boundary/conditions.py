"""Boundary conditions and loads of a scene on one rank's particles, the same for all particle methods.

A step of leapfrog (`methods.leapfrog.Leapfrog` makes these calls):

    conditions.begin_step(step)
    conditions.impose_mean(t, step)               # prescribed components move with their mean velocity of the step
    external = conditions.external_force(t, force, damping)
    ...                                           # opening kick with `external` and `conditions.free`, drift
    conditions.place(t + step, step)              # prescribed displacements and rotations, exactly
    conditions.observe(step / 2)                  # works and reactions of the forces, with present x and v
    ...                                           # forces of the new state
    external = conditions.external_force(t + step, force, damping, before_jump=True)
    conditions.observe(step / 2)
    ...                                           # closing kick
    conditions.impose(t + step)                   # prescribed velocities
    work = conditions.end_step(step, ledger)      # external work of what moves prescribed components

Stages of SSP-RK3 call `external_force(time of the stage, ...)`, `observe(weight step)` and `impose(next time)` in turn.
A static solution calls `loads` and `motion.displace(t, step, u)`. The material point method has `Loads` alone, and
applies supports, prescribed motion (`of(MotionCondition)`, with its `course`) and `walls.RigidWall` to nodes; it calls
`find_reported` with its loads, `observe(duration, velocity)` and `report` at the end of its step.

Vectors are arrays (d, n) with a row for each component. `external_force` and `loads` are forces [N] on the parts of
particles on this side of mirror planes; `force` and `damping` are those on whole particles. The force of contact, tools
and ties is a field of the particles (`EXTERNAL_FORCE`), which integrators add; supports and motion resist it, too.

A new kind is a class of its keys in `scene/boundaries/`; if it derives from `Traction`, `Pressure` or `MotionCondition`
there, that is all. A new load is a class in `boundary.forces`; a new constraint is one in `boundary.constraints`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.boundary.constraints import InclinedRoller, Supports, inclined_rollers, mirror_plane
from parsolid.boundary.forces import tributary_mass
from parsolid.boundary.loads import Loads
from parsolid.boundary.motion import PrescribedMotion
from parsolid.boundary.reactions import Reaction
from parsolid.collective import anywhere
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import selected
from parsolid.scene.boundaries.condition import Condition
from parsolid.scene.boundaries.support import Support
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
        self._declare_free()
        # forces (k,) on prescribed components that were found last, and their work in the step
        self._resisted, self._work = np.zeros(0), 0.0

    def _find_holders(self) -> list[Holder]:
        """Those of supports that hold components of particles, and of prescribed motion."""
        result = []
        for _, one in self.all:
            reaction = self.reaction_of(one)
            if reaction is None:
                continue
            if any(component.condition is one for component in self.motion.components):
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

    def _declare_free(self) -> None:
        """Fields "held_components" and "free_components" (d, n) travel with the particles, where there are any."""
        self._any_held = anywhere(self.comm, bool(self.held.any()))
        self._any_constrained = self._any_held or self.motion.there
        if self._any_held:
            self.particles.declare(
                Field("held_components", self.dimension, "1", mirror="vector", layout=Columns()), 1.0 * self.held
            )
        if self._any_constrained:
            free = np.where(self.held, 0.0, 1.0)
            free[self.motion.rows, self.motion.axes] = 0.0
            self.particles.declare(
                Field("free_components", self.dimension, "1", mirror="vector", layout=Columns()), free
            )

    # --- what integrators ask -----------------------------------------------------------------------------------

    @property
    def free(self) -> np.ndarray | None:
        """Factors (d, capacity) of accelerations: 0 where a component is held or prescribed, else 1; None where none is
        on any rank."""
        return self.particles.storage("free_components") if self._any_constrained else None

    @property
    def constrained(self) -> np.ndarray | None:
        """Components (owned, d) bool that are held or prescribed, None where this rank has none."""
        if not self._any_constrained:
            return None
        mask = self.particles.owned_rows("free_components").reshape(-1, self.dimension) == 0.0
        return mask if mask.any() else None

    def hold(self, time: float) -> None:
        """Give velocities and prescribed displacements of a state the values that they have at a time [s]."""
        velocity = self._velocity()
        if self._any_held:
            velocity[self.particles.owned_rows("held_components").reshape(velocity.T.shape).T > 0.0] = 0.0
        for roller in self.rollers:
            velocity[:, roller.rows] -= roller.held(velocity[:, roller.rows])
        if self.motion.there:
            self.motion.place(time, False, self._displacement())
            at = self.motion.axes, self.motion.rows
            velocity[at] = self.motion.end_velocities(time, np.zeros(len(at[0])))

    def begin_step(self, step: float) -> None:
        """Keep what the energies of a step [s] need of its start."""
        velocity, self._work = self._velocity(), 0.0
        self._start = velocity[self.motion.axes, self.motion.rows] if self.motion.there else np.zeros(0)
        self._start_of_holders = [
            velocity[:, holder.find()[0]] if holder.prescribes else None for holder in self.holders
        ]

    def impose_mean(self, time: float, step: float) -> None:
        """Let prescribed components have their mean velocity of a step [s] from a time [s]."""
        if self.motion.there:
            change = self.motion.change(time, step, self._displacement())
            self._mean = change / step if step > 0.0 else np.zeros_like(change)
            self._velocity()[self.motion.axes, self.motion.rows] = self._mean

    def place(self, time: float, step: float) -> None:
        """Put what is prescribed exactly where it is at the end of a step [s] at a time [s], after a drift."""
        if self.motion.there:
            self.motion.place(time, step > 0.0, self._displacement())

    def impose(self, time: float, before_jump: bool = False) -> None:
        """Give prescribed components their velocity at a time [s], at a jump before or after it."""
        if self.motion.there:
            at = self.motion.axes, self.motion.rows
            velocity = self._velocity()
            velocity[at] = self.motion.end_velocities(time, velocity[at], before_jump)

    def external_force(
        self, time: float, force: np.ndarray, damping: np.ndarray | None = None, before_jump: bool = False
    ) -> np.ndarray | None:
        """Loads of a time [s] and what holds the particles of inclined rollers, (d, owned) [N]; None without any.

        force, damping (d, owned or more) [N]: internal and dissipative forces on whole particles at that time.
        """
        loads = external = self.loads(time, before_jump)
        self.find_reported(time, before_jump)
        if self.rollers:
            external = np.zeros((self.dimension, self.particles.owned)) if loads is None else loads.copy()
            for roller, reaction in zip(self.rollers, self._roller_reactions):
                rows = roller.rows
                held = -roller.held(self._acting(rows, force, damping, external))
                external[:, rows] += held
                if reaction is not None:
                    self._found.append((reaction, rows, held))
        for holder in self.holders:
            rows, components = holder.find()
            resisted = -self._acting(rows, force, damping, external) * components.T
            self._found.append((holder.reaction, rows, resisted))
        if self.motion.there:
            rows, axes = self.motion.rows, self.motion.axes
            self._resisted = -self._acting(rows, force, damping, external)[axes, np.arange(len(rows))]
        return external

    def _acting(
        self, rows: np.ndarray, force: np.ndarray, damping: np.ndarray | None, external: np.ndarray | None
    ) -> np.ndarray:
        """All forces (d, k) [N] on the parts of particles on this side of mirror planes."""
        result = force[:, rows] if damping is None else force[:, rows] + damping[:, rows]
        if "share" in self.particles:
            result = self.particles.owned_rows("share")[rows] * result
        if EXTERNAL_FORCE in self.particles:
            result = result + self.particles.owned_rows(EXTERNAL_FORCE).T[:, rows]
        return result if external is None else result + external[:, rows]

    def observe(self, duration: float, velocity: np.ndarray | None = None) -> None:
        """See `Loads.observe`; also the work of what moves prescribed components."""
        if self.motion.there:
            moving = self._velocity() if velocity is None else velocity
            self._work += duration * float(self._resisted @ moving[self.motion.axes, self.motion.rows])
        super().observe(duration, velocity)

    def end_step(self, step: float, ledger: Any) -> float:
        """External work [J] of what has moved prescribed components in a step [s]; reactions go to the ledger."""
        velocity, position = self._velocity(), self.particles.owned_rows("position").T
        for holder, start in zip(self.holders, self._start_of_holders):
            if start is not None:
                rows, components = holder.find()
                mass = tributary_mass(self.particles, rows) * components.T
                gained = 0.5 * float(np.sum(mass * (velocity[:, rows] ** 2 - start**2)))
                holder.reaction.add(position[:, rows], mass * (velocity[:, rows] - start), gained)
        if self.motion.there:
            rows = self.motion.rows
            now, mass = velocity[self.motion.axes, rows], tributary_mass(self.particles, rows)
            self._work += 0.5 * float(np.sum(mass * (now**2 - self._start**2)))
        self.report(step, ledger)
        return self._work

    def _displacement(self) -> np.ndarray | None:
        """Displacements (d, owned), a view, of a method that keeps them."""
        return self.particles.owned_rows("displacement").T if "displacement" in self.particles else None
