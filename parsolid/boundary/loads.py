"""Values in time: loads on particles, and what is prescribed; what is constant is evaluated once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from parsolid.boundary.rows import Everywhere, HasRows, OfRows
from parsolid.materials.registry import laws_of
from parsolid.particles.container import Particles
from parsolid.scene.base_model import Plane
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.schema import Scene


class Course(Protocol):
    """Values of place and time."""

    @property
    def depends_on_time(self) -> bool:
        """Whether they change."""

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """(n, components) at points (n, d) [m] and a time [s], of a jump just after, or just before it."""


@dataclass(frozen=True)
class MeanOverFace:
    """The mean of a course at places (k, d) [m] of a face, by their areas (k,) [m^2], wherever it is asked for."""

    course: Course
    places: np.ndarray
    area: np.ndarray

    @property
    def depends_on_time(self) -> bool:
        """Whether it changes."""
        return self.course.depends_on_time

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """(n, components), alike for all points (n, d)."""
        mean = self.area @ self.course.evaluate(self.places, time, before) / self.area.sum()
        return np.broadcast_to(mean, (len(points), len(mean)))


@dataclass(frozen=True)
class BeyondMean:
    """What a course is more than its mean."""

    course: Course
    mean: MeanOverFace

    @property
    def depends_on_time(self) -> bool:
        """Whether it changes."""
        return self.course.depends_on_time

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """(n, components) at points (n, d) [m] and a time [s]."""
        return self.course.evaluate(points, time, before) - self.mean.evaluate(points, time, before)


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

    def __init__(self, particles: Particles, parts: Sequence[Part], width: int):
        """result: (owned, width)."""
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

    particles: as in `InTime`; scale: (k,) at rows, from fields that travel with the particles; onto: a plane onto
    which places are moved before the course is evaluated there.
    """

    particles: Particles
    chosen: HasRows | Everywhere
    scale: OfRows
    course: Course
    onto: Plane | None = None
    _layout: int = -1
    _at: tuple[np.ndarray, np.ndarray] | None = None
    _constant: np.ndarray | None = None

    @property
    def depends_on_time(self) -> bool:
        """Whether it changes."""
        return self.course.depends_on_time

    def _places(self, rows: np.ndarray | slice) -> np.ndarray:
        places = self.particles.owned_rows("reference_position")[rows]
        if self.onto is not None:
            places = places.copy()
            places[:, self.onto.axis] = self.onto.offset
        return np.ascontiguousarray(places)

    def put(self, result: np.ndarray, time: float, before: bool = False) -> None:
        """Add its values to the first columns of result (owned, any)."""
        rows, values = self.chosen.rows, self._constant
        if self._layout != self.particles.layout or self._at is None:
            self._layout, self._at, values = self.particles.layout, (self._places(rows), self.scale(rows)), None
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

    @property
    def depends_on_time(self) -> bool:
        """Always."""
        return True

    def __init__(self, scene: Scene):
        # scipy takes half a second to import, which a run without it is spared
        from parsolid.exact import SOLUTIONS

        assert scene.reference is not None and scene.reference.exact is not None
        solutions: dict[str, Any] = SOLUTIONS
        self.solution = solutions[scene.reference.exact].of_scene(scene)

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """(n, d) at reference positions (n, d) [m] and a time [s]."""
        return np.asarray(self.solution.body_force(points, time))


def body_loads(scene: Scene, particles: Particles, per_volume: OfRows, per_mass: OfRows) -> list[Load]:
    """Loads of a scene on all bodies.

    per_volume, per_mass: what a force per volume and an acceleration are multiplied with, (k,) at rows.
    """
    loads, everything, result = scene.loads, Everywhere(), []
    for formulas, scale in ((loads.body_force, per_volume), (loads.acceleration, per_mass)):
        if formulas is not None:
            result.append(Load(particles, everything, scale, LoadHistory(formulas, loads)))
    if loads.manufactured:
        result.append(Load(particles, everything, per_mass, ExactBodyForce(scene)))
    return result


def area_along(particles: Particles, axis: int) -> OfRows:
    """Areas (k,) [m^2] with which particles at rows bound their body along an axis."""
    return lambda rows: np.abs(particles.owned_rows("area")[rows, axis])


def densities(scene: Scene, particles: Particles) -> OfRows:
    """Densities (k,) [kg/m^3] of particles at rows."""
    of_body = np.array([law.density for law in laws_of(scene)])
    return lambda rows: of_body[particles.owned_rows("body")[rows]]


def accelerations(scene: Scene, particles: Particles, *more: Load) -> InTime:
    """Accelerations (owned, 4) [m/s^2] of a scene's loads on all bodies, and of more loads before them."""
    density = densities(scene, particles)
    loads = body_loads(scene, particles, lambda rows: 1.0 / density(rows), lambda rows: np.ones(particles.owned))
    return InTime(particles, [*more, *loads], 4)
