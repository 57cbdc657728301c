"""Tractions on peridynamic bodies.

A traction t on a plane with normal n acts as the forces that balance a uniform stress, f = -f_int(t (x) n), kept near
the plane ("consistent"): then a uniform stress is an exact solution on a lattice, which it is not under forces on the
particles at the face ("single-layer") or spread over the horizon ("horizon"). Irregular particles carry a uniform
stress only under small forces inside, too ("consistent-everywhere").

What a traction that varies over its face has beyond its mean acts on the particles at the face: near edges the forces
of a uniform stress are not those of the area of each particle, and their moment under t(y) would be too small.

A pressure p acts on a surface of any shape as p times the forces -f_int(-1) of the particles near it: a body under one
pressure all around has its exact strain, whatever stairs its particles make of its surface.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.reduction import ordered_sum
from parsolid.boundary.declarations import Declarations, RegionTraction, SurfacePressure, SurfaceTraction
from parsolid.boundary.loads import BeyondMean, Course, Load, MeanOverFace, area_along
from parsolid.boundary.rows import keep
from parsolid.boundary.supports import Supports
from parsolid.boundary.surfaces import Surface
from parsolid.collective import SolverError, maximum, minimum
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.regions import selected
from parsolid.solvers import start_vector

# of a face's particles, so many give the mean of its traction
_SAMPLE = 256


@dataclass(frozen=True)
class Along:
    """The first component of a course along one axis of d."""

    course: Course
    axis: int
    dimension: int

    @property
    def depends_on_time(self) -> bool:
        """Whether it changes."""
        return self.course.depends_on_time

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """(n, d), all but one column 0."""
        result = np.zeros((len(points), self.dimension))
        result[:, self.axis] = self.course.evaluate(points, time, before)[:, 0]
        return result


class Tractions:
    """Makes the forces of a scene's tractions on a rank's particles; all methods are collective."""

    def __init__(
        self,
        comm: MPI.Comm,
        declared: Declarations,
        supports: Supports,
        particle_set: ParticleSet,
        particles: Particles,
    ):
        """particles: those of the particle_set."""
        self.comm, self.declared, self.supports = comm, declared, supports
        self.particle_set, self.particles = particle_set, particles

    def forces(self, forces: Any) -> list[tuple[str, Load]]:
        """Keys of conditions and forces [N] on the particles, several of one; forces: of `forces.build_forces`, all
        bonds whole."""
        return self._of_planes(forces) + self._pressures(forces)

    def _pressures(self, forces: Any) -> list[tuple[str, Load]]:
        """The forces that balance a uniform pressure, in the region of each pressure."""
        pressures, d, loads = self.declared.of(SurfacePressure), self.particle_set.position.shape[1], []
        if not pressures:
            return []
        unit = self._unit(forces)
        # what is left inside a regular body is rounding
        least = 1e-12 * maximum(self.comm, float(np.abs(unit).max(initial=0.0)))
        known = self.declared.scene.named_regions
        for one in pressures:
            name = one.where.region_name
            if name is not None and known[name].groups(known):
                expected = "a region in space, with what lies within two horizons of the surface"
                raise SolverError(f"{one.key}.where: expected {expected}, found a group of a mesh in {name!r}")
            within = selected(self.declared.scene, one.where, self.particle_set, self.comm)
            for axis in range(d):
                chosen = within & (np.abs(unit[:, axis]) > least)
                scale = keep(self.particles, f"force_per_pressure_{one.key}_{axis}", unit[:, axis])
                load = Load(self.particles, self.particles.selection(chosen), scale, Along(one.course, axis, d))
                loads.append((one.key, load))
        return loads

    def _unit(self, forces: Any) -> np.ndarray:
        """Force (owned, d) [m^2] of a uniform unit stress, 1."""
        unit_stress = np.tile(np.eye(forces.bonds.d), (len(self.particle_set), 1, 1))
        unit: np.ndarray = forces.of_stress(unit_stress) * self.supports.share[:, None]
        return unit

    def _of_planes(self, forces: Any) -> list[tuple[str, Load]]:
        tractions = self.declared.of(SurfaceTraction)
        reach = maximum(self.comm, float(forces.bonds.horizon.max(initial=0.0)))
        kind = self.declared.scene.method.traction
        there = [(one.key, self._in_region(one, kind)) for one in self.declared.of(RegionTraction)]
        return [*self._on_planes(tractions, kind, reach, forces), *there]

    def _in_region(self, one: RegionTraction, kind: str) -> Load:
        """Traction times area on the particles of a surface; raises SolverError on all ranks for the ways that spread
        it along a normal."""
        if kind != "single-layer":
            expected = 'a plane, or method.traction = "single-layer" for a surface without one normal'
            raise SolverError(f"{one.key}.where: expected {expected}, found {one.where.region_name!r} and {kind!r}")
        surface = Surface(self.comm, self.declared, one, self.particle_set, self.particles)
        return Load(self.particles, surface.chosen, surface.areas, one.course)

    def _on_planes(
        self, tractions: list[SurfaceTraction], kind: str, reach: float, forces: Any
    ) -> list[tuple[str, Load]]:
        if kind == "horizon":
            return [(one.key, self._spread(one, reach)) for one in tractions]
        if not kind.startswith("consistent"):
            return [(one.key, self._at_face(one, one.course)) for one in tractions]
        if not tractions:
            return []
        unit = self._unit(forces)
        depth = 2.0 * reach if kind == "consistent" else np.inf
        means = [self._mean(one) for one in tractions]
        pairs, keys = list(zip(tractions, means)), [one.key for one in tractions]
        inside = [self._consistent(one, mean, unit[:, one.plane.axis], depth) for one, mean in pairs]
        beyond = [self._at_face(one, BeyondMean(one.course, mean)) for one, mean in pairs]
        return [*zip(keys, inside), *zip(keys, beyond)]

    def _mean(self, one: SurfaceTraction) -> MeanOverFace:
        """The mean of a traction over its face, or over some particles of a large one, the same on any number of
        ranks."""
        mine, particles = self._face(one), self.particle_set
        places = particles.position[mine].copy()
        places[:, one.plane.axis] = one.plane.offset
        area = np.abs(particles.area[mine, one.plane.axis])
        lot = start_vector(particles.identifier[mine], 1)[:, 0]
        rows = sorted(zip(lot, area, *places.T))[:_SAMPLE]
        found = sorted(row for piece in self.comm.allgather(rows) for row in piece)[:_SAMPLE]
        sample = np.array(found).reshape(-1, 2 + places.shape[1])
        return MeanOverFace(one.course, np.ascontiguousarray(sample[:, 2:]), sample[:, 1])

    def _face(self, one: SurfaceTraction) -> np.ndarray:
        """Which particles (owned,) bool are those of the face."""
        return selected(self.declared.scene, one.where, self.particle_set, self.comm)

    def _at_face(self, one: SurfaceTraction, course: Course) -> Load:
        """Traction times area on the particles of the face."""
        area = area_along(self.particles, one.plane.axis)
        return Load(self.particles, self.particles.selection(self._face(one)), area, course, one.plane)

    def _area(self, one: SurfaceTraction) -> float:
        """Area [m^2] of the face on all ranks."""
        face = self._face(one)
        return float(ordered_sum(self.comm, np.abs(self.particle_set.area[face, one.plane.axis])))

    def _spread(self, one: SurfaceTraction, reach: float) -> Load:
        """The face's force on the volume within the horizon."""
        particles, beneath = self.particles, self._beneath(one)[0] <= reach
        depth = ordered_sum(self.comm, self.particle_set.volume[beneath]) / self._area(one)
        chosen = particles.selection(beneath)
        return Load(particles, chosen, lambda rows: particles.owned_rows("volume")[rows] / depth, one.course, one.plane)

    def _consistent(self, one: SurfaceTraction, mean: MeanOverFace, unit: np.ndarray, depth: float) -> Load:
        """Forces that balance the uniform stress t (x) n of the mean traction down to a depth [m]; unit (owned,): those
        of n (x) n."""
        distance, outward = self._beneath(one)
        within = distance <= min(depth, self._middle(one, distance))
        # what is left inside a regular body is rounding
        within &= np.abs(unit) > 1e-12 * maximum(self.comm, float(np.abs(unit).max(initial=0.0)))
        scale = -outward * unit
        farthest = maximum(self.comm, float(distance[np.isfinite(distance)].max(initial=0.0)))
        if depth < min(farthest, self._middle(one, distance)):
            # where particles are irregular the force of the face's area is not quite met
            scale *= self._area(one) / ordered_sum(self.comm, scale[within])
        kept = keep(self.particles, f"force_per_traction_{one.key}", scale)
        return Load(self.particles, self.particles.selection(within), kept, mean)

    def _beneath(self, one: SurfaceTraction) -> tuple[np.ndarray, float]:
        """Distance (owned,) [m] of particles meant from the face, infinite for others; sign of its normal."""
        particle_set, plane = self.particle_set, one.plane
        meant = np.ones(len(particle_set), bool)
        if one.where.body is not None:
            meant = particle_set.body == self.declared.bodies[one.where.body]
        offset = particle_set.position[:, plane.axis] - plane.offset
        low = minimum(self.comm, float(offset[meant].min(initial=np.inf)))
        high = maximum(self.comm, float(offset[meant].max(initial=-np.inf)))
        return np.where(meant, np.abs(offset), np.inf), 1.0 if abs(high) < abs(low) else -1.0

    def _middle(self, one: SurfaceTraction, distance: np.ndarray) -> float:
        """How deep consistent forces may go: to the middle of a body, beyond which they belong to the face across."""
        axis, offset = one.plane.axis, one.plane.offset
        if any(plane.axis == axis and plane.coordinate != offset for plane in self.supports.planes):
            return np.inf
        inside = distance[np.isfinite(distance)]
        nearest = minimum(self.comm, float(inside.min(initial=np.inf)))
        farthest = maximum(self.comm, float(inside.max(initial=-np.inf)))
        return 0.5 * (nearest + farthest)
