"""Loads of a scene on one rank's particles, for all methods, with the reactions of those that report their force."""

from math import inf
from typing import Any, NamedTuple, TypeVar

import numpy as np
from mpi4py import MPI

from parsolid.boundary.forces import Load, body_loads, surface_load
from parsolid.boundary.kernels import observe_entries, observe_forces, set_loads
from parsolid.boundary.reactions import Reaction
from parsolid.boundary.surface import Surface
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.boundaries import Condition
from parsolid.scene.schema import Scene

_Kind = TypeVar("_Kind", bound=Condition)


class Entries(NamedTuple):
    """Components of particles on which forces of conditions act: rows (k,) and parts (p, 4), see `boundary.kernels`, in
    the order: prescribed, so many parts as `moving`; other ones that are held, up to `holding`; loads that change, up
    to `changing`; reported loads that do not. force (k,) [N]: what acted on them when it was found or observed last;
    counted: whether anything asks for its impulse or work."""

    moving: int
    holding: int
    changing: int
    rows: np.ndarray
    parts: np.ndarray
    force: np.ndarray
    counted: bool


# parts of entries, each with an axis, the number of a reaction and rows (k,)
Parts = list[tuple[int, int, np.ndarray]]


class Loads:
    """All loads on a rank's particles: those on all bodies, and those of conditions on surfaces.

    all: keys and conditions of the scene; loads_of: loads with the reaction that reports their force, or None;
    loaded: rows (k,) of particles that have loads, None where these are many, once loads were found; reactions: of
    conditions that report theirs. Vectors are arrays (d, n) of forces [N] on the parts of particles on
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
        # of all reactions, see `boundary.kernels`
        self._make_sums()
        # forces (d, k) found last of what is no entry: number of the reaction, rows, forces
        self._reported: list[tuple[int, np.ndarray, np.ndarray]] = []
        self._layout, self._entries = -1, _entries_of([], [], [], [], len(self.reactions))
        self._jumps = {*scene.loads.jump_times}
        for _, one in self.all:
            if getattr(one, "quantity", "") == "displacement":
                self._jumps.update(one.prescribed.jump_times)
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
            self._make_sums()
        return found

    def number_of(self, condition: Condition) -> int:
        """Which of the reactions is that of a condition; how many there are where none is."""
        found = (i for i, one in enumerate(self.reactions) if one.condition is condition)
        return next(found, len(self.reactions))

    def _make_sums(self) -> None:
        """Rows of one array for the sums of all reactions, and of what no reaction takes."""
        self._about = np.zeros((len(self.reactions) + 1, self.dimension))
        self._sums = np.zeros((len(self.reactions) + 1, self.dimension + (2 if self.dimension == 2 else 4)))
        for one, about, sums in zip(self.reactions, self._about, self._sums):
            about[:], one.sums = one.about, sums

    @property
    def times(self) -> tuple[float, ...]:
        """Times [s] after the start and before the end at which loads or prescribed displacements jump."""
        return tuple(sorted(time for time in self._jumps if 0.0 < time < self.end_time))

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] of this rank's springs and dashpots."""
        result = inf
        for load, _ in self.loads_of:
            result = min(result, load.largest_step)
        return result

    def find_loads(self, time: float, before_jump: bool = False) -> np.ndarray | None:
        """Forces (d, owned) [N] of all loads at a time [s], at a jump before or after it; None where there are none.

        They are void when others are found; `observe` counts those that are reported.
        """
        self._reported.clear()
        if self._layout != self.particles.layout:
            self._find_entries(time, before_jump)
        if not self.loads_of:
            return None
        at = self._entries
        for load, place in self._on_some:
            at.force[place] = load.forces(time, before_jump)[1].ravel()
        if self._on_all:
            self._present_loads[:] = self._constant_loads
        set_loads(at.rows, at.parts, at.holding, at.changing, at.force, self._constant_loads, self._present_loads)
        for load in self._on_all:
            forces = load.forces(time, before_jump)[1]
            self._present_loads[: len(forces)] += forces
        return self._present_loads

    def surface_forces(self, time: float) -> np.ndarray:
        """Forces (d, owned) [N] of loads on surfaces at a time [s], of parts on this side of mirror planes."""
        result = np.zeros((self.dimension, self.particles.owned))
        for load, _ in self.loads_of:
            if load.on_surface:
                rows, forces = load.forces(time, False)
                result[: len(forces), rows] += forces
        return result

    def _find_entries(self, time: float, before_jump: bool) -> None:
        """Find entries and constant loads anew, as particles have changed their rows or masses, with the forces of a
        time [s] as an example."""
        self._layout = self.particles.layout
        self._constant_loads = np.zeros((self.dimension, self.particles.owned))
        changing, constant, values = Parts(), Parts(), [np.zeros(0)]
        of_changing, self._on_all = list[tuple[Load, int]](), list[Load]()
        loaded = np.zeros(self.particles.owned, bool)
        for load, reaction in self.loads_of:
            number = len(self.reactions) if reaction is None else self.reactions.index(reaction)
            rows, forces = load.forces(time, before_jump)
            loaded[rows] = True
            if load.constant:
                self._constant_loads[: len(forces), rows] += forces
            if isinstance(rows, slice):
                self._on_all += [] if load.constant else [load]
            elif not load.constant:
                changing += [(axis, number, rows) for axis in range(len(forces))]
                of_changing.append((load, len(forces)))
            elif reaction is not None:
                constant += [(axis, number, rows) for axis in range(len(forces))]
                values.append(forces.ravel())
        self._present_loads = self._constant_loads.copy()
        few = self.loads_of and 3 * loaded.sum() < self.particles.owned
        self.loaded = np.flatnonzero(loaded) if few else None
        moving, held = self._held_parts()
        self._entries = at = _entries_of(moving, held, changing, constant, len(self.reactions))
        at.force[len(at.force) - sum(map(len, values)) :] = np.concatenate(values)
        self._on_some, part = list[tuple[Load, slice]](), at.holding
        for load, axes in of_changing:
            self._on_some.append((load, slice(at.parts[part, 0], at.parts[part + axes - 1, 1])))
            part += axes

    def _held_parts(self) -> tuple[Parts, Parts]:
        """Of components that are prescribed, and of others that are held; none."""
        return [], []

    def _acting(self) -> Any:
        """Forces on components that are held, see `boundary.kernels.observe_entries`; none."""
        return None

    def keep_deformation(self) -> None:
        """Let loads use the present deformation, which a stage changes before its forces are asked for."""
        for load, _ in self.loads_of:
            load.keep_deformation()

    def masses_changed(self) -> None:
        """Find loads anew, after particles were deleted."""
        self._layout = -1
        for load, _ in self.loads_of:
            load.masses_changed()

    def observe(self, duration: float, velocity: np.ndarray | None = None) -> float:
        """Count impulses and works over a duration [s] of the forces found last, at present places and with velocities
        (d, n) [m/s], the present ones unless given; the work [J] on prescribed components."""
        at, work = self._entries, 0.0
        if at.counted or self._reported:
            present, position = self.particles.kept(("velocities and positions", self), self._find_state)
            state = present if velocity is None else velocity, position, self._about, self._sums
            work = observe_entries(at.moving, at.holding, at.rows, at.parts, duration, at.force, self._acting(), *state)
            for one, rows, forces in self._reported:
                observe_forces(one, rows, duration, forces, *state)
        return work

    def _find_state(self) -> tuple[np.ndarray | None, np.ndarray]:
        """Velocities, None where the method states them, and positions (d, owned), views."""
        of = self.particles.owned_rows
        return of("velocity").T if "velocity" in self.particles else None, of("position").T

    def report(self, step: float, ledger: Any) -> None:
        """Let reactions take what was observed in a step [s] as its mean, and the ledger their work."""
        if not self.reactions:
            return
        for reaction, (*impulses, work) in zip(self.reactions, self._sums.tolist()):
            if step > 0.0 and any(impulses):
                reaction.impulses, reaction.duration = impulses, step
            ledger.add_term(reaction.term, work)
        self._sums[:] = 0.0

    def _velocity(self) -> np.ndarray:
        """Velocities (d, owned), a view."""
        return self.particles.owned_rows("velocity").T


def _entries_of(moving: Parts, held: Parts, changing: Parts, constant: Parts, unreported: int) -> Entries:
    """Entries of parts in this order; unreported: the number of no reaction."""
    parts = [*moving, *held, *changing, *constant]
    ends = np.cumsum([0, *(len(rows) for _, _, rows in parts)])
    table = [(ends[p], ends[p + 1], axis, number) for p, (axis, number, _) in enumerate(parts)]
    holding = len(moving) + len(held)
    counted = bool(moving) or any(number != unreported for _, number, _ in parts)
    rows = np.concatenate([np.zeros(0, np.int64), *(rows for _, _, rows in parts)])
    places = np.array(table, np.int64).reshape(-1, 4)
    return Entries(len(moving), holding, holding + len(changing), rows, places, np.zeros(ends[-1]), counted)
