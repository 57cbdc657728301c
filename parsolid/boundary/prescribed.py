"""Motion that a scene prescribes, on a rank's particles; the last condition holds."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from parsolid.boundary.declarations import Declarations, PrescribedMotion
from parsolid.boundary.rows import HasRows
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.regions import selected


@dataclass
class _Component:
    """One component of the motion of some particles; part: its place in the entries."""

    quantity: str
    chosen: HasRows
    index: int
    course: LoadHistory
    places: np.ndarray
    part: slice

    @property
    def depends_on_time(self) -> bool:
        return self.course.depends_on_time


class PrescribedRows:
    """Prescribed components of velocity [m/s] and displacement [m]: one row of `entries` for a component of a particle.

    guided: whether anything is prescribed, the same on all ranks.
    """

    def __init__(self, comm, declared: Declarations, particle_set, particles: Any):
        """particles: `Particles` or `rows.FixedParticles` of the particle_set; collective."""
        self.particles, self.components, self._layout = particles, [], -1
        wanted = []
        taken = np.zeros(particle_set.position.shape, bool)
        for one in reversed(declared.of(PrescribedMotion)):
            chosen, free = selected(declared.scene, one.where, particle_set, comm), one.course.free
            for index in np.flatnonzero(~free[: taken.shape[1]])[::-1]:
                # work is counted once: on what holds
                wanted.append((one.quantity, chosen & ~taken[:, index], int(index), one.course.component(index)))
                taken[:, index] |= chosen
        for quantity, mask, index, course in reversed(wanted):
            rows = particles.selection(mask)
            self.components.append(_Component(quantity, rows, index, course, np.zeros((0, 0)), slice(0)))
        self.guided = bool(self.components)

    def _look_up(self) -> None:
        if self._layout == self.particles.layout:
            return
        self._layout, first = self.particles.layout, 0
        places, none = self.particles.owned_rows("reference_position"), [np.zeros(0, np.int64)]
        for one in self.components:
            rows = one.chosen.rows
            one.places, one.part = places[rows], slice(first, first + len(rows))
            first += len(rows)
        indices = [np.full(len(one.places), one.index) for one in self.components]
        self._entries = (
            np.concatenate(none + [one.chosen.rows for one in self.components]),
            np.concatenate(none + indices),
        )
        self._constant = {}
        self._of = {
            quantity: np.concatenate(
                [np.zeros(0, bool)] + [np.full(len(one.places), one.quantity == quantity) for one in self.components]
            )
            for quantity in ("velocity", "displacement")
        }

    @property
    def entries(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and components (k,) of everything prescribed."""
        self._look_up()
        return self._entries

    def values(self, quantity: str, time: float, before: bool = False) -> np.ndarray:
        """(k,) for the entries at a time [s], of a jump just after, or just before it; 0 where another quantity is prescribed."""
        self._look_up()
        meant = [one for one in self.components if one.quantity == quantity]
        if quantity not in self._constant:
            self._constant[quantity] = np.zeros(len(self._entries[0]))
            for one in meant:
                if not one.depends_on_time:
                    self._constant[quantity][one.part] = one.course.evaluate(one.places)[:, 0]
        result = self._constant[quantity].copy()
        for one in meant:
            if one.depends_on_time:
                result[one.part] = one.course.evaluate(one.places, time, before)[:, 0]
        return result

    def move(self, time: float, step: float, displacement: np.ndarray) -> None:
        """Bring prescribed components of a displacement (owned, d) [m] from a time [s] to the end of a step [s].

        A step ends before a jump of that time, one of length 0 after it.
        """
        particles, components = self.entries
        for quantity, here in self._of.items():
            if not here.any():
                continue
            place = (particles[here], components[here])
            if quantity == "velocity":
                # Simpson's rule
                first, middle, last = (self.values(quantity, time + part * step)[here] for part in (0.0, 0.5, 1.0))
                displacement[place] += step / 6.0 * (first + 4.0 * middle + last)
            else:
                displacement[place] = self.values(quantity, time + step, step > 0.0)[here]

    def velocities(self, time: float, step: float, change: np.ndarray) -> np.ndarray:
        """Velocities (k,) [m/s] of the entries at the end of a step [s] of these changes (k,) [m] of displacement."""
        result = change / step if step > 0.0 else np.zeros_like(change)
        self._look_up()
        here = self._of["velocity"]
        if here.any():
            result[here] = self.values("velocity", time + step)[here]
        return result
