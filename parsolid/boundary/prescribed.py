"""Motion that a scene prescribes, on a rank's particles; the last condition holds."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import PrescribedMotion
from parsolid.boundary.rows import HasRows
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.regions import selected
from parsolid.scene.rigid_motion import RigidMotion
from parsolid.scene.schema import Scene


@dataclass
class _Component:
    """One component of the motion of some particles; part: its place in the entries."""

    quantity: str
    chosen: HasRows
    index: int
    course: LoadHistory | RigidMotion
    motion: PrescribedMotion
    part: slice = field(default_factory=lambda: slice(0))

    @property
    def depends_on_time(self) -> bool:
        return self.course.depends_on_time


class PrescribedRows:
    """Prescribed components of velocity [m/s] and displacement [m]: one row of `entries` for a component of a particle.

    guided: whether anything is prescribed, the same on all ranks.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        scene: Scene,
        motions: list[PrescribedMotion],
        particle_set: ParticleSet,
        particles: Particles,
    ):
        """particles: those of the particle_set; collective."""
        self.particles, self._layout = particles, -1
        self.components: list[_Component] = []
        self._constant: dict[str, np.ndarray] = {}
        self._places: np.ndarray | None = None
        wanted = []
        taken = np.zeros(particle_set.position.shape, bool)
        dimension = particle_set.position.shape[1]
        for one in reversed(motions):
            chosen, free = selected(scene, one.where, particle_set, comm), one.course.free
            for index in np.flatnonzero(~free[:dimension])[::-1]:
                # work is counted once: on what holds
                course = one.course.component(int(index))
                wanted.append((one, chosen & ~taken[:, index], int(index), course))
                taken[:, index] |= chosen
        for one, mask, index, course in reversed(wanted):
            self.components.append(_Component(one.quantity, particles.selection(mask), index, course, one))
        self.guided = bool(self.components)

    def _look_up(self) -> None:
        """Where everything prescribed is, anew when the particles have changed their rows."""
        if self._layout == self.particles.layout:
            return
        self._layout, first = self.particles.layout, 0
        self._constant, self._places = {}, None
        rows, indices, velocity = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0, bool)]
        for one in self.components:
            here = one.chosen.rows
            rows.append(here)
            indices.append(np.full(len(here), one.index))
            velocity.append(np.full(len(here), one.quantity == "velocity"))
            one.part, first = slice(first, first + len(here)), first + len(here)
        self._entries = np.concatenate(rows), np.concatenate(indices)
        self._is_velocity = np.concatenate(velocity)

    @property
    def entries(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and components (k,) of everything prescribed."""
        self._look_up()
        return self._entries

    def of(self, motion: PrescribedMotion) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) of a motion's particles and which of their components (k, d) it prescribes."""
        mine = [one for one in self.components if one.motion is motion]
        mask = np.zeros((self.particles.owned, self.particles.owned_rows("reference_position").shape[1]), bool)
        for one in mine:
            mask[one.chosen.rows, one.index] = True
        rows = np.flatnonzero(mask.any(axis=1))
        return rows, mask[rows]

    def values(self, quantity: str, time: float, before: bool = False) -> np.ndarray:
        """(k,) for the entries at a time [s], after or before a jump of that time; 0 where another is prescribed."""
        self._look_up()
        if self._places is None:
            self._places = self.particles.owned_rows("reference_position")[self._entries[0]]
        meant = [one for one in self.components if one.quantity == quantity]
        if quantity not in self._constant:
            self._constant[quantity] = np.zeros(len(self._places))
            self._fill(self._constant[quantity], [one for one in meant if not one.depends_on_time], 0.0, False)
        result = self._constant[quantity].copy()
        self._fill(result, [one for one in meant if one.depends_on_time], time, before)
        return result

    def _fill(self, result: np.ndarray, components: list[_Component], time: float, before: bool) -> None:
        assert self._places is not None
        for one in components:
            result[one.part] = one.course.evaluate(self._places[one.part], time, before)[:, 0]

    def move(self, time: float, step: float, displacement: np.ndarray) -> None:
        """Bring prescribed components of a displacement (owned, d) [m] from a time [s] to the end of a step [s].

        A step ends before a jump of that time, one of length 0 after it.
        """
        (particles, components), velocity = self.entries, self._is_velocity
        if velocity.any():
            # Simpson's rule
            first, middle, last = (self.values("velocity", time + part * step)[velocity] for part in (0.0, 0.5, 1.0))
            place = (particles[velocity], components[velocity])
            displacement[place] += step / 6.0 * (first + 4.0 * middle + last)
        if not velocity.all():
            place = (particles[~velocity], components[~velocity])
            displacement[place] = self.values("displacement", time + step, step > 0.0)[~velocity]

    def velocities(self, time: float, step: float, change: np.ndarray) -> np.ndarray:
        """Velocities (k,) [m/s] of the entries at the end of a step [s] of these changes (k,) [m] of displacement."""
        result = change / step if step > 0.0 else np.zeros_like(change)
        self._look_up()
        here = self._is_velocity
        if here.any():
            result[here] = self.values("velocity", time + step)[here]
        return result


class NotFree:
    """Components of velocities that are held or prescribed, wherever the particles are."""

    def __init__(self, particles: Particles, prescribed: PrescribedRows, clamp: Callable[[], np.ndarray | None]):
        """clamp: gives multipliers (owned, d or more) of velocities, 0 where one is held, or None."""
        self.particles, self.prescribed, self.clamp = particles, prescribed, clamp
        self._layout, self._mask, self._any = -1, np.zeros((0, 0), bool), False

    def mask(self, dimension: int) -> np.ndarray | None:
        """(owned, d) bool, None where this rank has none."""
        if self._layout != self.particles.layout:
            self._layout, clamp = self.particles.layout, self.clamp()
            self._mask = np.zeros((self.particles.owned, dimension), bool)
            if clamp is not None:
                self._mask |= clamp[:, :dimension] == 0.0
            self._mask[self.prescribed.entries] = True
            self._any = bool(self._mask.any())
        return self._mask if self._any else None
