"""Values in time: loads on particles, and what is prescribed; what is constant is evaluated once."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from parsolid.boundary.rows import Everywhere, HasRows
from parsolid.materials.registry import laws_of
from parsolid.scene.base_model import Plane
from parsolid.scene.load_histories import LoadHistory


class Part(Protocol):
    """What adds to values in time."""

    @property
    def depends_on_time(self) -> bool:
        """Whether it changes."""

    def put(self, result: np.ndarray, time: float, before: bool) -> None:
        """Add its values at a time [s], of a jump just after, or just before it."""

    def forget(self) -> None:
        """Keep nothing until the next `put`."""


class InTime:
    """The sum of parts at a time: constant ones are evaluated once for every layout of the particles."""

    def __init__(self, particles: Any, parts: list, width: int):
        """particles: `Particles` or `rows.FixedParticles`; result: (owned, width)."""
        self.particles, self.width = particles, width
        self.constant = [part for part in parts if not part.depends_on_time]
        self.changing = [part for part in parts if part.depends_on_time]
        self._layout, self._sum = -1, np.zeros((0, width))

    @property
    def acting(self) -> bool:
        """Whether there is any part, the same on all ranks."""
        return bool(self.constant or self.changing)

    def at(self, time: float, before: bool = False) -> np.ndarray:
        """Values (owned, width) at a time [s], of a jump just after, or just before it; not to be changed."""
        if self._layout != self.particles.layout:
            self._layout, self._sum = self.particles.layout, np.zeros((self.particles.owned, self.width))
            for part in self.constant:
                part.put(self._sum, 0.0, False)
                part.forget()
        if not self.changing:
            return self._sum
        result = self._sum.copy()
        for part in self.changing:
            part.put(result, time, before)
        return result


@dataclass
class Load:
    """scale * course(X, t) on some particles, or on all.

    particles: as in `InTime`; scale: (k,) at rows, from fields that travel with the particles; onto: a plane onto which places are
    moved before the course is evaluated there.
    """

    particles: Any
    chosen: HasRows | Everywhere
    scale: Callable[[Any], np.ndarray]
    course: LoadHistory
    onto: Plane | None = None

    def __post_init__(self) -> None:
        self.forget()

    @property
    def depends_on_time(self) -> bool:
        """Whether it changes."""
        return self.course.depends_on_time

    def _places(self, rows) -> np.ndarray:
        places = self.particles.owned_rows("reference_position")[rows]
        if self.onto is not None:
            places = places.copy()
            places[:, self.onto.axis] = self.onto.offset
        return places

    def put(self, result: np.ndarray, time: float, before: bool = False) -> None:
        """Add its values to the first columns of result (owned, any)."""
        rows = self.chosen.rows
        if self._layout != self.particles.layout:
            self._layout, self._at, self._constant = self.particles.layout, (self._places(rows), self.scale(rows)), None
        values = self._constant
        if values is None:
            places, scale = self._at
            values = scale[:, None] * self.course.evaluate(places, time, before)
            if not self.depends_on_time:
                self._constant = values
        result[rows, : values.shape[1]] += values

    def forget(self) -> None:
        """Keep nothing until the next `put`."""
        self._layout, self._at, self._constant = -1, None, None


class ExactBodyForce:
    """The acceleration [m/s^2] under which an exact solution holds, as a course."""

    depends_on_time = True

    def __init__(self, scene):
        # scipy takes half a second to import, which a run without it is spared
        from parsolid.exact import SOLUTIONS

        self.solution = SOLUTIONS[scene.reference.exact].of_scene(scene)

    def evaluate(self, points: np.ndarray, time: float, before: bool = False) -> np.ndarray:
        """(n, d) at reference positions (n, d) [m] and a time [s]."""
        return self.solution.body_force(points, time)


def body_loads(scene, particles: Any, per_volume: Callable, per_mass: Callable) -> list[Load]:
    """Loads of a scene on all bodies; per_volume, per_mass: what a force per volume and an acceleration are multiplied with, at rows."""
    loads, everything, result = scene.loads, Everywhere(), []
    for formulas, scale in ((loads.body_force, per_volume), (loads.acceleration, per_mass)):
        if formulas is not None:
            result.append(Load(particles, everything, scale, LoadHistory(formulas, loads)))
    if loads.manufactured:
        result.append(Load(particles, everything, per_mass, ExactBodyForce(scene)))
    return result


def area_along(particles: Any, axis: int) -> Callable[[Any], np.ndarray]:
    """Areas (k,) [m^2] with which particles at rows bound their body along an axis."""
    return lambda rows: np.abs(particles.owned_rows("area")[rows, axis])


def densities(scene, particles: Any) -> Callable[[Any], np.ndarray]:
    """Densities (k,) [kg/m^3] of particles at rows."""
    of_body = np.array([law.density for law in laws_of(scene)])
    return lambda rows: of_body[particles.owned_rows("body")[rows]]


def accelerations(scene, particles: Any, *more: Load) -> InTime:
    """Accelerations (owned, 4) [m/s^2] of a scene's loads on all bodies, and of more loads before them."""
    density = densities(scene, particles)
    per_mass = lambda rows: np.ones(particles.owned)  # noqa: E731
    return InTime(particles, [*more, *body_loads(scene, particles, lambda rows: 1.0 / density(rows), per_mass)], 4)
