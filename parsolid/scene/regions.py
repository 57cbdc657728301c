"""Which particles a region means, and which particle is nearest to a point: the same on any number of ranks."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.base_model import Plane
from parsolid.scene.boundaries import FictitiousLayer, RegionCondition
from parsolid.scene.schema import Scene

NOBODY = np.iinfo(np.int64).max


def nearest_particles(
    comm: MPI.Comm, identifier: np.ndarray, position: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Global id (m,) and distance (m,) [m] of the particle nearest to each point (m, d); the lowest id of equals (collective)."""
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


def selected(scene: Scene, boundary: Any, particle_set: ParticleSet, comm: MPI.Comm) -> np.ndarray:
    """Which particles (n,) bool a boundary condition is about (collective for a single point).

    A plane means the particles on it; where particles sit in cells, those whose cell it touches; where these cells are
    jittered or a mesh's, only those with a face on the surface of the body.
    """
    mask = np.ones(len(particle_set), bool)
    if boundary.body is not None:
        mask = particle_set.body == [body.name for body in scene.bodies].index(boundary.body)
    if isinstance(boundary, FictitiousLayer):
        return mask & _beside(boundary, particle_set)
    if not isinstance(boundary, RegionCondition) or boundary.plane is not None:
        return mask & _on_plane(scene, boundary.plane, particle_set)
    tolerance = 1e-6 * particle_set.spacing.min(axis=1)
    if boundary.box is not None:
        lower, upper = np.array(boundary.box.lower), np.array(boundary.box.upper)
        inside = (particle_set.position >= lower - tolerance[:, None]) & (
            particle_set.position <= upper + tolerance[:, None]
        )
        return mask & inside.all(axis=1)
    if boundary.ball is not None:
        distance = np.linalg.norm(particle_set.position - np.array(boundary.ball.centre), axis=1)
        return mask & (distance <= boundary.ball.radius + tolerance)
    winner, _ = nearest_particles(
        comm, particle_set.identifier[mask], particle_set.position[mask], np.array([boundary.point])
    )
    return mask & (particle_set.identifier == winner[0])


def _beside(layer: FictitiousLayer, particle_set: ParticleSet) -> np.ndarray:
    """Particles on one side of a plane, those on it too."""
    above = particle_set.position[:, layer.plane.axis] - layer.plane.offset
    return (above if layer.side == "above" else -above) >= -1e-6 * particle_set.spacing.min(axis=1)


def _on_plane(scene: Scene, plane: Plane, particle_set: ParticleSet) -> np.ndarray:
    """Particles on a plane: nodes within a rounding error, cells within their own half width."""
    result = np.zeros(len(particle_set), bool)
    distance = np.abs(particle_set.position[:, plane.axis] - plane.offset)
    extent = particle_set.spacing[:, plane.axis]
    if particle_set.axes is not None:
        # the particle's own widths, seen along the normal
        extent = (np.abs(particle_set.axes[:, :, plane.axis]) * particle_set.spacing).sum(axis=1)
    for i, body in enumerate(scene.bodies):
        uneven = body.shape.kind == "mesh"
        reach = 1e-6 if body.placed_on == "nodes" else 1.0 if uneven else 0.5 + body.jitter + 1e-6
        here = (particle_set.body == i) & (distance <= reach * extent)
        if body.placed_on == "cells" and (body.jitter or uneven):
            # their faces tell which of the cells bound the body here
            here &= particle_set.area[:, plane.axis] != 0.0
        result |= here
    return result
