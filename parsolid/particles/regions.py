"""The particles in a region, and the particle nearest to a point, the same on any number of ranks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.collective import SolverError
from parsolid.particles.generated import widths
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.boundaries import Condition
from parsolid.scene.named_regions import Region as NamedRegion
from parsolid.scene.regions import AtPlane, Named, NearestTo, Region
from parsolid.scene.schema import Scene

NOBODY = np.iinfo(np.int64).max


def nearest_particles(
    comm: MPI.Comm, identifier: np.ndarray, position: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Global id (m,) and distance (m,) [m] of the particle nearest to each point (m, d); of equals the lowest id.

    Collective.
    """
    points = np.asarray(points, float).reshape(-1, position.shape[1])
    squared = np.full(len(points), np.inf)
    names = np.full(len(points), NOBODY)
    for i, point in enumerate(points if len(position) else []):
        distance = ((position - point) ** 2).sum(axis=1)
        squared[i] = distance.min()
        names[i] = identifier[distance == squared[i]].min()
    least = np.empty_like(squared)
    comm.Allreduce(squared, least, op=MPI.MIN)
    names[squared > least] = NOBODY
    winner = np.empty_like(names)
    comm.Allreduce(names, winner, op=MPI.MIN)
    return winner, np.sqrt(least)


@dataclass(frozen=True)
class InSpace:
    """A named region of points in space."""

    table: NamedRegion
    known: dict[str, NamedRegion]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are in it."""
        return self.table.contains(places, tolerance, self.known, lambda name: np.zeros(len(places), bool))


def region_of(scene: Scene, key: str, condition: Condition) -> Any:
    """The region of a condition on places in space; raises SolverError for one with a group of a mesh."""
    name, known = condition.region_name, scene.named_regions
    if name is None:
        return condition.region
    if known[name].groups(known):
        expected = "a region in space for the nodes of a grid, which are in no group of a mesh"
        raise SolverError(f"{key}.where: expected {expected}, found {name!r}")
    return InSpace(known[name], known)


def selected(scene: Scene, boundary: Condition, particle_set: ParticleSet, comm: MPI.Comm) -> np.ndarray:
    """Which particles (n,) bool a boundary condition applies to (collective for a single point)."""
    among = np.ones(len(particle_set), bool)
    if boundary.body is not None:
        among = particle_set.body == [body.name for body in scene.bodies].index(boundary.body)
    return among & _particles_in(boundary.region, scene, particle_set, comm, among)


def _particles_in(
    region: Region, scene: Scene, particle_set: ParticleSet, comm: MPI.Comm, among: np.ndarray
) -> np.ndarray:
    """Which particles (n,) bool are in a region; for a single point the nearest of the particles `among` (n,)."""
    position = particle_set.position
    if isinstance(region, Named):
        return particles_of(region.name, scene, particle_set)
    if isinstance(region, AtPlane) and region.side is None:
        # nodes within a rounding error of a plane, cells within their own half width
        result, axis = np.zeros(len(particle_set), bool), region.plane.axis
        distance = np.abs(position[:, axis] - region.plane.offset)
        extent = widths(particle_set.spacing, particle_set.axes)[:, axis]
        for i, body in enumerate(scene.bodies):
            uneven = body.shape.kind == "mesh"
            reach = 1e-6 if body.placed_on == "vertices" else 1.0 if uneven else 0.5 + body.jitter + 1e-6
            here = (particle_set.body == i) & (distance <= reach * extent)
            if body.placed_on == "cells" and (body.jitter or uneven):
                # only cells with a face on the boundary of the body
                here &= particle_set.area[:, axis] != 0.0
            result |= here
        return result
    if isinstance(region, NearestTo):
        names = particle_set.identifier
        winner, _ = nearest_particles(comm, names[among], position[among], np.array([region.point]))
        return np.asarray(names == winner[0])
    return region.contains(position, 1e-6 * particle_set.spacing.min(axis=1))


def particles_of(name: str, scene: Scene, particle_set: ParticleSet) -> np.ndarray:
    """Which particles (n,) bool are in a named region."""
    assert particle_set.regions is not None
    return np.asarray(particle_set.regions[:, list(scene.named_regions).index(name)] == 1)
