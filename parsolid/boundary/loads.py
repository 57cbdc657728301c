"""Loads of a scene on one rank's particles, for all methods, with the reactions of those that report their force."""

from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from parsolid.boundary.forces import Load, Rows, body_loads, surface_load
from parsolid.boundary.reactions import Reaction
from parsolid.boundary.surface import Surface
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.boundaries.condition import Condition
from parsolid.scene.schema import Scene

_Kind = TypeVar("_Kind", bound=Condition)


class Loads:
    """All loads on a rank's particles: those on all bodies, and those of conditions on surfaces.

    all: keys and conditions of the scene; loads_of: loads with the reaction that reports their force, or None;
    reactions: of conditions that report theirs. Vectors are arrays (d, n) of forces [N] on the parts of particles on
    this side of mirror planes.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        scene: Scene,
        particle_set: ParticleSet,
        particles: Particles,
        others: tuple[type[Condition], ...] = (),
    ):
        """particles: those of the particle set, with reference positions and areas; their fields "mass" and, if they
        have one, "share" are needed from the first loads on. others: conditions of which the method itself makes loads,
        see `add_load`. Raises SolverError on all ranks. Collective."""
        self.comm, self.scene, self.particle_set, self.particles = comm, scene, particle_set, particles
        self.dimension, self.end_time = scene.dimension, scene.end_time
        self.all: list[tuple[str, Condition]] = [(f"boundaries.{i}", one) for i, one in enumerate(scene.boundaries)]
        self.reactions: list[Reaction] = []
        self.loads_of: list[tuple[Load, Reaction | None]] = []
        # forces found last, and who reports them
        self._found: list[tuple[Reaction, Rows, np.ndarray]] = []
        self._layout = -1
        self._jumps = {*scene.loads.jump_times}
        for _, one in self.all:
            if getattr(one, "quantity", "") == "displacement":
                self._jumps.update(one.course.jump_times)  # type: ignore[attr-defined]
        for key, one in self.all:
            make = None if isinstance(one, others) else surface_load(one)
            if make is not None:
                self.add_load(make(one, Surface(comm, scene, key, one, particle_set, particles)), one)
        for load in body_loads(scene, particles):
            self.add_load(load)

    def of(self, kind: type[_Kind]) -> list[tuple[str, _Kind]]:
        """Keys and conditions of a kind, in the order of the scene."""
        return [(key, one) for key, one in self.all if isinstance(one, kind)]

    def add_load(self, load: Load, condition: Condition | None = None) -> None:
        """Add a load, of a condition that may report it; all ranks alike."""
        self.loads_of.append((load, self.reaction_of(condition)))
        self._jumps.update(load.times)
        self._layout = -1

    def reaction_of(self, condition: Condition | None) -> Reaction | None:
        """The reaction of a condition that reports its force, one for all that belongs to it."""
        if condition is None or condition.reports is None:
            return None
        found = next((one for one in self.reactions if one.condition is condition), None)
        if found is None:
            found = Reaction(condition, self.dimension)
            self.reactions.append(found)
        return found

    @property
    def times(self) -> tuple[float, ...]:
        """Times [s] after the start and before the end at which loads or prescribed displacements jump."""
        return tuple(sorted(time for time in self._jumps if 0.0 < time < self.end_time))

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] of this rank's springs and dashpots."""
        return min((load.largest_step for load, _ in self.loads_of), default=np.inf)

    def loads(self, time: float, before_jump: bool = False) -> np.ndarray | None:
        """Forces (d, owned) [N] of all loads at a time [s], at a jump before or after it; not to be changed. None where
        a scene has no loads."""
        if not self.loads_of:
            return None
        if self._layout != self.particles.layout:
            self._layout = self.particles.layout
            self._constant_loads = np.zeros((self.dimension, self.particles.owned))
            self._add(self._constant_loads, True, 0.0, False)
        if all(load.constant for load, _ in self.loads_of):
            return self._constant_loads
        result = self._constant_loads.copy()
        self._add(result, False, time, before_jump)
        return result

    def _add(self, result: np.ndarray, constant: bool, time: float, before_jump: bool) -> None:
        """Add the forces of loads that are constant, or that are not."""
        for load, _ in self.loads_of:
            if load.constant == constant:
                rows, forces = load.forces(time, before_jump)
                result[: len(forces), rows] += forces

    def look(self) -> None:
        """Keep what loads need of the present deformation, which a stage changes before its forces are asked for."""
        for load, _ in self.loads_of:
            if hasattr(load, "look"):
                load.look()

    def forget_masses(self) -> None:
        """Find loads anew, after particles were deleted."""
        self._layout = -1
        for load, _ in self.loads_of:
            if hasattr(load, "forget"):
                load.forget()

    def find_reported(self, time: float, before_jump: bool = False) -> None:
        """Find the forces of a time [s] that `observe` counts."""
        self._found = [
            (reaction, *load.forces(time, before_jump)) for load, reaction in self.loads_of if reaction is not None
        ]

    def observe(self, duration: float, velocity: np.ndarray | None = None) -> None:
        """Count impulses and works over a duration [s] of the forces found last, at present places and with velocities
        (d, n) [m/s], the present ones unless given."""
        if self._found:
            position = self.particles.owned_rows("position").T
            velocity = self._velocity() if velocity is None else velocity
            for reaction, rows, forces in self._found:
                work = duration * float(np.sum(forces * velocity[:, rows]))
                reaction.add(position[:, rows], duration * forces, work)

    def report(self, step: float, ledger: Any) -> None:
        """Let reactions take what was observed in a step [s] as its mean, and the ledger their work."""
        for reaction in self.reactions:
            reaction.finish(step, ledger)

    def _velocity(self) -> np.ndarray:
        """Velocities (d, owned), a view."""
        return self.particles.owned_rows("velocity").T
