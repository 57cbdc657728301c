"""Which particles a region means, and which particle is nearest to a point: the same on any number of ranks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from mpi4py import MPI

from parsolid.collective import SolverError
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.base_model import Plane
from parsolid.scene.named_regions import Region as NamedRegion

if TYPE_CHECKING:
    from parsolid.scene.boundaries import Condition
    from parsolid.scene.schema import Scene

NOBODY = np.iinfo(np.int64).max


def nearest_particles(
    comm: MPI.Comm, identifier: np.ndarray, position: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Global id (m,) and distance (m,) [m] of the particle nearest to each point (m, d); the lowest id of equals.

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


class Region(Protocol):
    """A part of space, of which a boundary condition speaks."""

    def particles(self, scene: Scene, particle_set: ParticleSet, comm: MPI.Comm, meant: np.ndarray) -> np.ndarray:
        """Which particles (n,) bool are in it, of those that are meant (n,); collective for a single point."""

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are in it, to a tolerance [m]."""

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether a box (d,), (d,) [m], grown by a tolerance [m], may have a part of it."""


@dataclass(frozen=True)
class _Geometric:
    """A region whose particles are those that are in it to a rounding error."""

    def particles(self, scene: Scene, particle_set: ParticleSet, comm: MPI.Comm, meant: np.ndarray) -> np.ndarray:
        """Which particles (n,) bool are in it."""
        return self.contains(particle_set.position, 1e-6 * particle_set.spacing.min(axis=1))

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        raise NotImplementedError

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether the point of the box that is nearest to the middle of the region is in it."""
        return bool(self.contains(np.clip(self.middle(), lower, upper)[None], tolerance)[0])

    def middle(self) -> np.ndarray:
        """A point (d,) [m] in the middle; of a region without one, infinity on its side."""
        raise NotImplementedError


@dataclass(frozen=True)
class OnPlane:
    """A plane: the particles on it.

    Where particles sit in cells, those whose cell it touches; where these cells are jittered or a mesh's, only those
    with a face on the surface of the body.
    """

    plane: Plane

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are on it."""
        return np.asarray(np.abs(places[:, self.plane.axis] - self.plane.offset) <= tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """Whether the plane cuts or bounds the box."""
        axis, offset = self.plane.axis, self.plane.offset
        return bool(lower[axis] - tolerance <= offset <= upper[axis] + tolerance)

    def particles(self, scene: Scene, particle_set: ParticleSet, comm: MPI.Comm, meant: np.ndarray) -> np.ndarray:
        """Nodes within a rounding error, cells within their own half width."""
        result, axis = np.zeros(len(particle_set), bool), self.plane.axis
        distance, extent = np.abs(particle_set.position[:, axis] - self.plane.offset), particle_set.spacing[:, axis]
        if particle_set.axes is not None:
            # the particle's own widths, seen along the normal
            extent = (np.abs(particle_set.axes[:, :, axis]) * particle_set.spacing).sum(axis=1)
        for i, body in enumerate(scene.bodies):
            uneven = body.shape.kind == "mesh"
            reach = 1e-6 if body.placed_on == "vertices" else 1.0 if uneven else 0.5 + body.jitter + 1e-6
            here = (particle_set.body == i) & (distance <= reach * extent)
            if body.placed_on == "cells" and (body.jitter or uneven):
                # their faces tell which of the cells bound the body here
                here &= particle_set.area[:, axis] != 0.0
            result |= here
        return result


@dataclass(frozen=True)
class Beside(_Geometric):
    """One side of a plane, those on it too."""

    plane: Plane
    side: Literal["above", "below"]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are there."""
        above = places[:, self.plane.axis] - self.plane.offset
        return np.asarray((above if self.side == "above" else -above) >= -tolerance)

    def middle(self) -> np.ndarray:
        """Infinitely far on its side."""
        return np.full(1, np.inf if self.side == "above" else -np.inf)


@dataclass(frozen=True)
class InBox(_Geometric):
    """A box with axis-aligned faces, [m]."""

    lower: list[float]
    upper: list[float]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are in it."""
        slack = np.broadcast_to(tolerance, len(places))[:, None]
        inside = (places >= np.array(self.lower) - slack) & (places <= np.array(self.upper) + slack)
        return np.asarray(inside.all(axis=1))

    def middle(self) -> np.ndarray:
        """Half-way between the corners."""
        return 0.5 * (np.array(self.lower) + np.array(self.upper))


@dataclass(frozen=True)
class InBall(_Geometric):
    """A ball, [m]."""

    centre: list[float]
    radius: float

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Which places (n, d) [m] are in it."""
        return np.asarray(np.linalg.norm(places - np.array(self.centre), axis=1) <= self.radius + tolerance)

    def middle(self) -> np.ndarray:
        """The centre."""
        return np.array(self.centre)


@dataclass(frozen=True)
class NearestTo:
    """The particle nearest to a point [m]."""

    point: list[float]

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Places that are the point."""
        return np.asarray(np.linalg.norm(places - np.array(self.point), axis=1) <= tolerance)

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """True: some particle is the nearest."""
        return True

    def particles(self, scene: Scene, particle_set: ParticleSet, comm: MPI.Comm, meant: np.ndarray) -> np.ndarray:
        """The nearest of those that are meant."""
        identifier = particle_set.identifier
        winner, _ = nearest_particles(comm, identifier[meant], particle_set.position[meant], np.array([self.point]))
        return np.asarray(identifier == winner[0])


@dataclass(frozen=True)
class Named:
    """A region with a name, whose particles were found when they were made."""

    name: str

    def contains(self, places: np.ndarray, tolerance: np.ndarray | float) -> np.ndarray:
        """Nothing: see `region_of`."""
        raise NotImplementedError

    def meets(self, lower: np.ndarray, upper: np.ndarray, tolerance: float) -> bool:
        """True: it may."""
        return True

    def particles(self, scene: Scene, particle_set: ParticleSet, comm: MPI.Comm, meant: np.ndarray) -> np.ndarray:
        """Those of the region."""
        assert particle_set.regions is not None
        return np.asarray(particle_set.regions[:, list(scene.named_regions).index(self.name)] == 1)


@dataclass(frozen=True)
class InSpace:
    """A region with a name, of places in space."""

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
    """Which particles (n,) bool a boundary condition is about (collective for a single point)."""
    meant = np.ones(len(particle_set), bool)
    if boundary.body is not None:
        meant = particle_set.body == [body.name for body in scene.bodies].index(boundary.body)
    return np.asarray(meant & boundary.region.particles(scene, particle_set, comm, meant))
