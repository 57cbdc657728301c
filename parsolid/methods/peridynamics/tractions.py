"""Tractions and pressures on peridynamic bodies, whose forces a face alone cannot take up.

A traction t on a plane with normal n acts as the forces that balance a uniform stress, f = -f_int(t (x) n), kept near
the plane ("consistent"): then a uniform stress is an exact solution on a lattice, which it is not under forces on the
particles at the face ("single-layer") or spread over the horizon ("horizon"). Irregular particles carry a uniform
stress only under small forces inside, too ("consistent-everywhere").

What a traction that varies over its face has beyond its mean acts on the particles at the face: near edges the forces
of a uniform stress are not those of the area of each particle, and their moment under t(y) would be too small.

A pressure p acts on a surface of any shape as p times the forces -f_int(-1) of the particles near it: a body under one
pressure all around has its exact strain, whatever stairs its particles make of its surface.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.boundary.conditions import Conditions
from parsolid.boundary.forces import DistributedLoad, TractionLoad
from parsolid.boundary.surface import Surface
from parsolid.collective import SolverError, maximum, minimum
from parsolid.particles.generated import widths
from parsolid.particles.regions import selected
from parsolid.scene.base_model import Plane
from parsolid.scene.boundaries import Pressure, Traction
from parsolid.scene.codes import Warned
from parsolid.scene.load_histories import SpaceTimeFunction
from parsolid.solvers import start_vector

# of a face's particles, so many give the mean of its traction
_SAMPLE = 256
# what is left inside a regular body of the force of a uniform stress is rounding
_ROUNDING = 1e-12
# of the force on a surface, what a region may miss
_MISSED = 0.1


@dataclass(frozen=True)
class DerivedFunction(SpaceTimeFunction):
    """What follows from another function; derive(points, time, before) -> (n, components)."""

    function: SpaceTimeFunction
    derive: Callable[[np.ndarray, float, bool], np.ndarray]

    @property
    def depends_on_time(self) -> bool:
        return bool(self.function.depends_on_time)

    @property
    def jump_times(self) -> tuple[float, ...]:
        """Times [s] at which it jumps."""
        return tuple(self.function.jump_times)

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """(n, components) at points (n, d) [m] and a time [s]."""
        return self.derive(points, time, before)


def mean_over_face(function: SpaceTimeFunction, places: np.ndarray, area: np.ndarray) -> DerivedFunction:
    """The mean of a function at places (k, d) [m] of a face, by their areas (k,) [m^2], the same at all points."""

    def derive(points: np.ndarray, time: float, before: bool) -> np.ndarray:
        mean = area @ function.evaluate(places, time, before) / area.sum()
        return np.broadcast_to(mean, (len(points), len(mean)))

    return DerivedFunction(function, derive)


def beyond_mean(function: SpaceTimeFunction, mean: DerivedFunction) -> DerivedFunction:
    """What a function has beyond its mean over a face."""
    return DerivedFunction(function, lambda *at: np.asarray(function.evaluate(*at) - mean.evaluate(*at)))


def along_axis(function: SpaceTimeFunction, axis: int, dimension: int) -> DerivedFunction:
    """The first component of a function along one axis of d; all but one column 0."""
    direction = np.eye(dimension)[axis]
    return DerivedFunction(function, lambda *at: function.evaluate(*at)[:, :1] * direction)


def least_rows(comm: Any, rows: np.ndarray, most: int) -> np.ndarray:
    """Of rows (n, c) on all ranks, `most` at most with the least first numbers, within -1 .. 1 and distinct, in their
    order, on every rank; what is exchanged does not grow with the ranks. Collective."""
    below, beyond = -2.0, 1.0
    if sums(comm, [float(len(rows))])[0] <= most:
        below = beyond
    while below < (middle := 0.5 * (below + beyond)) < beyond:
        count = sums(comm, [float(np.count_nonzero(rows[:, 0] <= middle))])[0]
        below, beyond = (middle, beyond) if count <= most else (below, middle)
        if count == most:
            break
    mine = rows[rows[:, 0] <= below]
    first = comm.exscan(len(mine)) or 0
    found = np.zeros((most, rows.shape[1] + 1))
    found[first : first + len(mine)] = np.column_stack((np.ones(len(mine)), mine))
    found = sums(comm, found)
    found = found[found[:, 0] > 0.0, 1:]
    return np.asarray(found[np.argsort(found[:, 0])])


class Tractions:
    """Adds the loads of a scene's tractions and pressures to the conditions of a rank's particles, which have made none
    of them; all methods are collective. A peridynamic particle keeps its row."""

    def __init__(self, conditions: Conditions, forces: Any) -> None:
        """forces: of `forces.build_forces`, with all bonds whole. Raises SolverError on all ranks."""
        self.conditions, self.comm, self.scene = conditions, conditions.comm, conditions.scene
        self.particles, self.particle_set = conditions.particles, conditions.particle_set
        kind, tractions = self.scene.method.traction, conditions.of(Traction)
        self.horizon = maximum(self.comm, float(forces.bonds.horizon.max(initial=0.0)))
        # force (owned, d) [m^2] of a uniform unit stress, 1
        self.unit = np.zeros_like(self.particle_set.position)
        if conditions.of(Pressure) or (tractions and kind.startswith("consistent")):
            unit_stress = np.tile(np.eye(forces.bonds.d), (len(self.particle_set), 1, 1))
            self.unit = forces.of_stress(unit_stress) * conditions.share[:, None]
        self.warnings: list[Warned] = []
        self.least = _ROUNDING * maximum(self.comm, np.abs(self.unit).max(axis=0, initial=0.0))
        for key, one in tractions:
            if one.plane is None:
                self._add_in_region(key, one)
            elif kind == "horizon":
                self._add_spread(one, one.plane)
            elif kind == "single-layer":
                self._add_at_face(one, one.plane, one.prescribed)
            else:
                mean = self._mean(one, one.plane)
                self._add_consistent(one, one.plane, mean, 2.0 * self.horizon if kind == "consistent" else np.inf)
                self._add_at_face(one, one.plane, beyond_mean(one.prescribed, mean))
        for key, pressure in conditions.of(Pressure):
            self._add_pressure(key, pressure)

    def _add(
        self, one: Traction | Pressure, here: np.ndarray, scale: np.ndarray, function: SpaceTimeFunction, plane: Any
    ) -> None:
        """Add scale (owned,) [m^2] times a function on particles (owned,) bool."""
        selection = self.particles.selection(here)
        self.conditions.add_load(DistributedLoad(self.particles, selection, scale.__getitem__, function, plane), one)

    def _add_pressure(self, key: str, one: Pressure) -> None:
        """The forces that balance a uniform pressure, in the region of the pressure."""
        known, name, d = self.scene.named_regions, one.region_name, self.scene.dimension
        if name is not None and known[name].groups(known):
            expected = "a region in space, with what lies within two horizons of the surface"
            raise SolverError(f"{key}.where: expected {expected}, found a group of a mesh in {name!r}")
        within = selected(self.scene, one, self.particle_set, self.comm)
        self._warn_of_thin_region(key, within)
        for axis in range(d):
            here = within & (np.abs(self.unit[:, axis]) > self.least.max())
            self._add(one, here, self.unit[:, axis].copy(), along_axis(one.prescribed, axis, d), None)

    def _warn_of_thin_region(self, key: str, within: np.ndarray) -> None:
        """The forces that balance a pressure reach over two horizons; a region that cuts them off bears another force
        than its area times the pressure, or widens a hole by another one."""
        force, area = self.unit[within], self.particle_set.area[within] * self.conditions.share[within, None]
        place, d = self.particle_set.position[within], area.shape[1]
        wide = widths(self.particle_set.spacing, self.particle_set.axes)
        for plane in self.conditions.planes:
            # matter goes on there
            near = np.abs(place[:, plane.axis] - plane.coordinate) <= wide[within, plane.axis]
            area[near, plane.axis] = 0.0
        size = np.linalg.norm(area, axis=1)
        totals = sums(self.comm, np.column_stack((size, size[:, None] * place, force + area)).sum(axis=0))
        whole, left = float(totals[0]), np.abs(totals[1 + d :]).max()
        if not whole > 0.0:
            return
        arm = place - totals[1 : 1 + d] / whole
        widened = float(sums(self.comm, np.sum(arm * (force + area))))
        reach = maximum(self.comm, float(np.linalg.norm(arm, axis=1).max(initial=0.0)))
        missed = max(left / whole, abs(widened) / (reach * whole))
        if missed > _MISSED:
            told = f"{key}: the region bears {missed:.0%} less or more than its area times the pressure"
            self.warnings.append(
                Warned("thin-pressure-region", f"{told}; it has to hold all within two horizons", True)
            )

    def _add_in_region(self, key: str, one: Traction) -> None:
        """Traction times area on the particles of a surface; refused where it would have to spread along a normal."""
        kind = self.scene.method.traction
        if kind != "single-layer":
            expected = 'a plane, or method.traction = "single-layer" for a surface without one normal'
            raise SolverError(f"{key}.where: expected {expected}, found {one.region_name!r} and {kind!r}")
        surface = Surface(self.comm, self.scene, key, one, self.particle_set, self.particles)
        self.conditions.add_load(TractionLoad(one, surface), one)

    def _add_at_face(self, one: Traction, plane: Plane, function: SpaceTimeFunction) -> None:
        """Traction times area on the particles of the face."""
        area = np.abs(self.particle_set.area_in_planes()[:, plane.axis])
        self._add(one, self._face(one), area, function, plane)

    def _add_spread(self, one: Traction, plane: Plane) -> None:
        """The face's force on the volume within the horizon."""
        volume, beneath = self.particle_set.volume, self._beneath(one, plane)[0] <= self.horizon
        depth = float(sums(self.comm, volume[beneath].sum())) / self._area(one, plane)
        self._add(one, beneath, volume / depth, one.prescribed, plane)

    def _add_consistent(self, one: Traction, plane: Plane, mean: DerivedFunction, depth: float) -> None:
        """Forces that balance the uniform stress t (x) n of the mean traction down to a depth [m]."""
        unit = self.unit[:, plane.axis]
        distance, outward = self._beneath(one, plane)
        middle = self._middle(plane, distance)
        within = (distance <= min(depth, middle)) & (np.abs(unit) > self.least[plane.axis])
        scale = -outward * unit
        if depth < min(maximum(self.comm, float(distance[np.isfinite(distance)].max(initial=0.0))), middle):
            # where particles are irregular the force of the face's area is not quite met
            scale *= self._area(one, plane) / float(sums(self.comm, scale[within].sum()))
        self._add(one, within, scale, mean, None)

    def _mean(self, one: Traction, plane: Plane) -> DerivedFunction:
        """The mean of a traction over its face, or over some particles of a large one, the same on any number of
        ranks."""
        mine, particles = self._face(one), self.particle_set
        places = particles.position[mine].copy()
        places[:, plane.axis] = plane.offset
        area = np.abs(particles.area_in_planes()[mine, plane.axis])
        rows = np.column_stack((start_vector(particles.identifier[mine], 1)[:, 0], area, places))
        sample = least_rows(self.comm, rows, _SAMPLE)
        return mean_over_face(one.prescribed, np.ascontiguousarray(sample[:, 2:]), sample[:, 1])

    def _face(self, one: Traction) -> np.ndarray:
        """Which particles (owned,) bool are those of the face."""
        return selected(self.scene, one, self.particle_set, self.comm)

    def _area(self, one: Traction, plane: Plane) -> float:
        """Area [m^2] of the face on all ranks."""
        area = self.particle_set.area_in_planes()[self._face(one), plane.axis]
        return float(sums(self.comm, np.abs(area).sum()))

    def _beneath(self, one: Traction, plane: Plane) -> tuple[np.ndarray, float]:
        """Distance (owned,) [m] of particles meant from the face, infinite for others; sign of its normal."""
        meant = np.ones(len(self.particle_set), bool)
        if one.body is not None:
            meant = self.particle_set.body == [body.name for body in self.scene.bodies].index(one.body)
        offset = self.particle_set.position[:, plane.axis] - plane.offset
        low = minimum(self.comm, float(offset[meant].min(initial=np.inf)))
        high = maximum(self.comm, float(offset[meant].max(initial=-np.inf)))
        return np.where(meant, np.abs(offset), np.inf), 1.0 if abs(high) < abs(low) else -1.0

    def _middle(self, plane: Plane, distance: np.ndarray) -> float:
        """How deep consistent forces may go: to the middle of a body, beyond which they belong to the face across."""
        planes = self.conditions.planes
        if any(one.axis == plane.axis and one.coordinate != plane.offset for one in planes):
            return np.inf
        inside = distance[np.isfinite(distance)]
        nearest = minimum(self.comm, float(inside.min(initial=np.inf)))
        farthest = maximum(self.comm, float(inside.max(initial=-np.inf)))
        return 0.5 * (nearest + farthest)
