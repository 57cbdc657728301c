"""Prescribed motion: velocity or displacement of components of particles; the last condition holds."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import selected
from parsolid.particles.selection import Selection
from parsolid.scene.boundaries.condition import Condition
from parsolid.scene.boundaries.prescribed import MotionCondition
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.rigid_motion import RigidMotion
from parsolid.scene.schema import Scene


class _Component(NamedTuple):
    """One prescribed component of the particles of a condition; course: its values in time."""

    condition: MotionCondition
    is_velocity: bool
    selection: Selection
    axis: int
    course: LoadHistory | RigidMotion


class PrescribedMotion:
    """Prescribed components of a rank's particles, one entry for a component of a particle.

    Velocities are integrated over a step by Simpson's rule. A rotation prescribes displacements where the method takes
    them, else the velocity of the rotation, and its particles are put exactly where they are at the end of each step.
    there: whether anything is prescribed, the same on all ranks.
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
        prescribed_axes = []
        for k, one in enumerate(motions):
            here, axes = selected(scene, one, particle_set, comm), ~one.course.free[: scene.dimension]
            number[here[:, None] & axes] = k
            prescribed_axes.append(np.flatnonzero(axes))
        self.components: list[_Component] = []
        self._rotations: list[tuple[MotionCondition, RigidMotion]] = []
        for k, one in enumerate(motions):
            course, is_velocity = one.course, one.quantity == "velocity"
            if isinstance(course, RigidMotion) and "displacement" not in scene.method.prescribes:
                self._rotations.append((one, course))
                course, is_velocity = course.velocity(), True
            for axis in map(int, prescribed_axes[k]):
                selection = particles.selection(number[:, axis] == k)
                self.components.append(_Component(one, is_velocity, selection, axis, course.component(axis)))
        self.there = bool(self.components)

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

    def _follow_layout(self) -> None:
        """Look the rows of all entries up, anew after particles have changed their rows."""
        if self._layout == self.particles.layout:
            return
        self._layout = self.particles.layout
        rows = [one.selection.rows for one in self.components]
        ends = np.cumsum([0, *map(len, rows)])
        self._parts = [slice(first, last) for first, last in pairwise(ends)]
        counts = list(map(len, rows))
        self._rows = np.concatenate([np.zeros(0, np.int64), *rows])
        self._axes = np.repeat(np.array([one.axis for one in self.components], np.int64), counts)
        self._is_velocity = np.repeat(np.array([one.is_velocity for one in self.components], bool), counts)
        self._places = np.ascontiguousarray(self.particles.owned_rows("reference_position")[self._rows])
        constant = [i for i, one in enumerate(self.components) if not one.course.depends_on_time]
        changing = [i for i in range(len(self.components)) if i not in constant]
        self._constant = self._evaluated(constant, 0.0, False)
        self._changing = {
            kind: [i for i in changing if self.components[i].is_velocity == kind] for kind in (True, False)
        }

    def _evaluated(self, components: list[int], time: float, before_jump: bool) -> np.ndarray:
        """Values (k,) of some components, zero for entries of others."""
        result = np.zeros(len(self._rows))
        for i in components:
            part = self._parts[i]
            result[part] = self.components[i].course.evaluate(self._places[part], time, before_jump)[:, 0]
        return result

    def _values(self, of_velocity: bool, time: float, before_jump: bool) -> np.ndarray:
        """Values (k,) of entries whose velocity, or displacement, is prescribed; those of the others are void."""
        self._follow_layout()
        if not self._changing[of_velocity]:
            return self._constant
        return self._constant + self._evaluated(self._changing[of_velocity], time, before_jump)

    def velocities(self, time: float, before_jump: bool = False) -> np.ndarray:
        """Velocities (k,) [m/s] at a time [s]; only for entries with a prescribed velocity, zero for others."""
        self._follow_layout()
        return np.where(self._is_velocity, self._values(True, time, before_jump), 0.0)

    def change(self, time: float, step: float, displacement: np.ndarray | None) -> np.ndarray:
        """By how much (k,) [m] the entries are displaced in a step [s] from a time [s]; displacement (d, n) [m]: the
        present one, where displacements are prescribed."""
        self._follow_layout()
        result = np.zeros(len(self._rows))
        if self._is_velocity.any() and step > 0.0:
            first, middle = (self._values(True, time + part * step, False) for part in (0.0, 0.5))
            last = self._values(True, time + step, True)
            result = step / 6.0 * (first + 4.0 * middle + last)
        if not self._is_velocity.all():
            assert displacement is not None
            # a step ends before a jump at its end; a step of length zero takes the jump
            target = self._values(False, time + step, step > 0.0)
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
        if displacement is not None and not self._is_velocity.all():
            here = ~self._is_velocity
            place = self._axes[here], self._rows[here]
            displacement[place] = self._values(False, time, before_jump)[here]
        for one, rotation in self._rotations:
            rows, components = self.held_by(one)
            start, position = (self.particles.owned_rows(name) for name in ("reference_position", "position"))
            there = np.ascontiguousarray(start[rows])
            position[rows] = np.where(components, there + rotation.evaluate(there, time), position[rows])

    def end_velocities(self, time: float, mean: np.ndarray, before_jump: bool = False) -> np.ndarray:
        """Velocities (k,) [m/s] at the end of a step at a time [s]: those prescribed, or the mean ones (k,) of the step
        where displacements are prescribed."""
        if not self.there:
            return mean
        return np.where(self._is_velocity, self._values(True, time, before_jump), mean)

    def held_by(self, condition: Condition) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) of the particles of one condition, and which of their components (k, d) it prescribes."""
        mask = np.zeros((self.particles.owned, self.particles.owned_rows("reference_position").shape[1]), bool)
        for one in self.components:
            if one.condition is condition:
                mask[one.selection.rows, one.axis] = True
        rows = np.flatnonzero(mask.any(axis=1))
        return rows, mask[rows]
