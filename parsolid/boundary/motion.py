"""Prescribed motion: velocity or displacement of components of particles; the last condition holds."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.boundary.kernels import add_modes, put
from parsolid.particles.container import Particles, Selection
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import selected
from parsolid.scene.boundaries import Condition, MotionCondition
from parsolid.scene.load_histories import LoadHistory, RigidMotion, Separated
from parsolid.scene.schema import Scene

# of so many times factors are kept: start, middle and end of a step
_KEPT = 3


class _Driven(NamedTuple):
    """The particles of one condition; axes: prescribed components with the particles of which this condition prescribes
    them; rotation: where only velocities are prescribed, the displacement that they follow."""

    condition: MotionCondition
    is_velocity: bool
    function: LoadHistory | RigidMotion
    axes: list[tuple[int, Selection]]
    rotation: RigidMotion | None


class _LocalCondition(NamedTuple):
    """A condition on this rank: rows (k,) of its particles, start (k, d) [m]: where they were, components (k, d) that
    it prescribes; entries: all of this condition; parts: entries, axis, and which of its particles they are."""

    driven: _Driven
    rows: np.ndarray
    start: np.ndarray
    components: np.ndarray
    entries: slice
    parts: list[tuple[slice, int, Any]]


class _Values:
    """Values (count,) of entries in time, sums of factors times modes, see `load_histories.Separated`."""

    def __init__(
        self, count: int, functions: list[tuple[_LocalCondition, Separated]], two_sided_times: frozenset[float]
    ) -> None:
        """two_sided_times: see `SpaceTimeFunction`."""
        self._functions, self._two_sided = [function for _, function in functions], two_sided_times
        self._known: dict[tuple[float, bool], list[Any]] = {}
        self._base, modes, table, size, first = np.zeros(count), [], [np.zeros(0)], 0, 0
        # entries with factors of their own: their number, and mode (k,)
        self._pointwise: list[tuple[slice, Any, int, np.ndarray]] = []
        for here, function in functions:
            for where, axis, which in here.parts:
                for _, number, mode in (one for one in function.modes if one.component == axis):
                    values = np.broadcast_to(mode, len(here.rows))[which]
                    if number is None:
                        self._base[where] += values
                    elif function.pointwise[number]:
                        self._pointwise.append((where, which, first + number, values))
                    else:
                        modes.append((where.start, where.stop, first + number, size))
                        table.append(values)
                        size += len(values)
            first += len(function.pointwise)
        self._modes, self._table = np.array(modes, np.int64).reshape(-1, 4), np.concatenate(table)

    def factors(self, time: float, before_jump: bool) -> list[Any]:
        """All factors at a time [s], found once for each of the last times."""
        moment = time, before_jump and time in self._two_sided
        found = self._known.get(moment)
        if found is None:
            if len(self._known) == _KEPT:
                del self._known[next(iter(self._known))]
            found = [one for function in self._functions for one in function.factors(time, before_jump)]
            self._known[moment] = found
        return found

    def of(self, factors: list[Any]) -> np.ndarray:
        """Values (count,) for some factors."""
        result = self._base.copy()
        if self._pointwise:
            for where, which, number, mode in self._pointwise:
                result[where] += factors[number][which] * mode
            factors = [one if np.ndim(one) == 0 else 0.0 for one in factors]
        if len(self._modes):
            add_modes(self._modes, self._table, np.array(factors), result)
        return result

    def at(self, time: float, before_jump: bool = False) -> np.ndarray:
        """Values (count,) at a time [s]."""
        return self.of(self.factors(time, before_jump))

    def mean(self, time: float, step: float) -> np.ndarray:
        """Mean values (count,) over a step [s] from a time [s], by Simpson's rule."""
        first, middle = self.factors(time, False), self.factors(time + 0.5 * step, False)
        last = self.factors(time + step, True)
        return self.of([(a + 4.0 * b + c) / 6.0 for a, b, c in zip(first, middle, last)])


class PrescribedMotion:
    """Prescribed components of a rank's particles, one entry for a component of a particle.

    Velocities are integrated over a step by Simpson's rule. A rotation prescribes displacements where the method takes
    them, else the velocity of the rotation, and its particles are put exactly where they are at the end of each step.
    Values are found once for each time.
    there: whether anything is prescribed, the same on all ranks; all_velocities: whether no entry of this rank has a
    prescribed displacement, once its rows were looked up.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        scene: Scene,
        conditions: list[tuple[str, Condition]],
        particle_set: ParticleSet,
        particles: Particles,
    ):
        """particles: those of the particle set. Collective."""
        self.particles, self._layout = particles, -1
        motions = [one for _, one in conditions if isinstance(one, MotionCondition)]
        number = np.full(particle_set.position.shape, -1)
        for k, one in enumerate(motions):
            here, axes = selected(scene, one, particle_set, comm), ~one.prescribed.free[: scene.dimension]
            number[here[:, None] & axes] = k
        self.driven: list[_Driven] = []
        for k, one in enumerate(motions):
            function, is_velocity, rotation = one.prescribed, one.quantity == "velocity", None
            if isinstance(function, RigidMotion) and "displacement" not in scene.method.prescribes:
                function, is_velocity, rotation = function.velocity(), True, function
            free = one.prescribed.free[: scene.dimension]
            chosen = [(axis, particles.selection(number[:, axis] == k)) for axis in map(int, np.flatnonzero(~free))]
            self.driven.append(_Driven(one, is_velocity, function, chosen, rotation))
        self._two_sided = frozenset().union(*(one.function.two_sided_times for one in self.driven))
        self.there = any(one.axes for one in self.driven)

    @property
    def rows(self) -> np.ndarray:
        """Row (k,) of each entry."""
        self._follow_layout()
        return self._rows

    @property
    def axes(self) -> np.ndarray:
        """Component (k,) of each entry."""
        self._follow_layout()
        return self._axes

    def prescribes(self, condition: Condition) -> bool:
        """Whether a condition is one of those that prescribe components."""
        return any(one.condition is condition and one.axes for one in self.driven)

    def parts(self, owner: Callable[[Condition], int]) -> np.ndarray:
        """All entries in parts (p, 4), see `boundary.kernels`; owner: number of the reaction of a condition."""
        self._follow_layout()
        return _parts_of(self._local, owner)

    def held_by(self, condition: Condition) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) of the particles of one condition, and which of their components (k, d) it prescribes."""
        self._follow_layout()
        return next((one.rows, one.components) for one in self._local if one.driven.condition is condition)

    def _follow_layout(self) -> None:
        """Look the rows of all entries up, anew after particles have changed their rows."""
        if self._layout == self.particles.layout:
            return
        self._layout, self._local, count = self.particles.layout, [], 0
        for one in self.driven:
            self._local.append(self._find_local(one, count))
            count = self._local[-1].entries.stop
        self._rows, self._axes = np.zeros((2, count), np.int64)
        self._is_velocity, self._start = np.zeros(count, bool), np.zeros(count)
        for here in self._local:
            self._is_velocity[here.entries] = here.driven.is_velocity
            for where, axis, which in here.parts:
                self._rows[where], self._axes[where] = here.rows[which], axis
        self.all_velocities, self._any_velocity = bool(self._is_velocity.all()), bool(self._is_velocity.any())
        of_velocity, of_displacement = (
            [(one, one.driven.function.separated(one.start)) for one in self._local if one.driven.is_velocity == kind]
            for kind in (True, False)
        )
        self._velocities = _Values(count, of_velocity, self._two_sided)
        self._displacements = _Values(count, of_displacement, self._two_sided)
        turning = [(one, one.driven.rotation) for one in self._local if one.driven.rotation is not None]
        self._turned = _Values(count, [(one, motion.separated(one.start)) for one, motion in turning], self._two_sided)
        self._turning = _parts_of([one for one, _ in turning], lambda condition: 0)
        for here, _ in turning:
            for where, axis, which in here.parts:
                self._start[where] = here.start[which, axis]

    def _find_local(self, one: _Driven, first: int) -> _LocalCondition:
        """A condition on this rank, whose first entry has this number."""
        start = self.particles.owned_rows("reference_position")
        mask, parts, last = np.zeros(start.shape, bool), [], first
        for axis, selection in one.axes:
            mask[selection.rows, axis] = True
        rows = np.flatnonzero(mask.any(axis=1))
        for axis, selection in one.axes:
            whole = len(selection) == len(rows)
            which = slice(None) if whole else np.searchsorted(rows, selection.rows)
            parts.append((slice(last, last + len(selection)), axis, which))
            last += len(selection)
        return _LocalCondition(one, rows, np.ascontiguousarray(start[rows]), mask[rows], slice(first, last), parts)

    def mean_velocity(self, time: float, step: float, displacement: np.ndarray | None) -> np.ndarray:
        """Mean velocities (k,) [m/s] of the entries in a step [s] from a time [s], 0 in one of no length; displacement
        (d, n) [m]: the present one, where displacements are prescribed."""
        self._follow_layout()
        if step == 0.0:
            return np.zeros(len(self._rows))
        if self.all_velocities:
            return self._velocities.mean(time, step)
        return self.change(time, step, displacement) / step

    def change(self, time: float, step: float, displacement: np.ndarray | None) -> np.ndarray:
        """By how much (k,) [m] the entries are displaced in a step [s] from a time [s]; displacement as above."""
        self._follow_layout()
        result = np.zeros(len(self._rows))
        if self._any_velocity and step > 0.0:
            result = step * self._velocities.mean(time, step)
        if not self.all_velocities:
            assert displacement is not None
            # a step ends before a jump at its end; a step of length zero takes the jump
            target = self._displacements.at(time + step, step > 0.0)
            result = np.where(self._is_velocity, result, target - displacement[self._axes, self._rows])
        return result

    def displace(self, time: float, step: float, displacement: np.ndarray) -> None:
        """Bring the entries of a displacement (d, n) [m] from a time [s] to the end of a step [s]."""
        change = self.change(time, step, displacement)
        displacement[self._axes, self._rows] += change
        self.place(time + step, step > 0.0, displacement)

    def place(self, time: float, before_jump: bool, displacement: np.ndarray | None) -> None:
        """Put particles exactly where they are at a time [s]: prescribed components of displacement (d, n), and
        positions of particles in rotation where only velocities are prescribed."""
        self._follow_layout()
        if displacement is not None and not self.all_velocities:
            here = ~self._is_velocity
            place = self._axes[here], self._rows[here]
            displacement[place] = self._displacements.at(time, before_jump)[here]
        if len(self._turning):
            places = self._start + self._turned.at(time)
            put(self._rows, self._turning, places, self.particles.storage("position"))

    def end_velocities(self, time: float, mean: np.ndarray | None, before_jump: bool = False) -> np.ndarray:
        """Velocities (k,) [m/s] at the end of a step at a time [s]: those prescribed, or the mean ones (k,) of the step
        where displacements are prescribed."""
        self._follow_layout()
        values = self._velocities.at(time, before_jump)
        if self.all_velocities:
            return values
        assert mean is not None
        return np.where(self._is_velocity, values, mean)


def _parts_of(conditions: list[_LocalCondition], owner: Callable[[Condition], int]) -> np.ndarray:
    """Their entries in parts (p, 4), see `boundary.kernels`; owner: number of the reaction of a condition."""
    parts = [(w.start, w.stop, axis, owner(one.driven.condition)) for one in conditions for w, axis, _ in one.parts]
    return np.array(parts, np.int64).reshape(-1, 4)
