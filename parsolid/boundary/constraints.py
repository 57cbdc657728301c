"""Supports: components of particles that do not move, mirror planes, and rollers inclined to the axes."""

from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.mirror_planes import MirrorCodes, MirrorPlane, check_sides, mirror_codes
from parsolid.boundary.surface import Surface
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import selected
from parsolid.scene.boundaries import Condition, Support
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.schema import Scene

# a direction whose part that nothing else holds is shorter than this is held already
_PARALLEL = 1e-6


def mirror_plane(scene: Scene, one: Support) -> MirrorPlane:
    """The plane of a support that has one."""
    assert one.plane is not None
    body = None if one.body is None else [body.name for body in scene.bodies].index(one.body)
    motion = None if one.velocity is None else LoadHistory(one.velocity)
    return MirrorPlane(one.plane.axis, one.plane.offset, one.kind, body, motion)


class Supports:
    """Mirror planes and components at rest; arrays are in the order of the particle set.

    planes: mirror planes; ends: planes of half bodies, which have no images there; codes: every reflection, None
    without planes; held (n, d) bool: components at rest; share (n,): the part of a particle on this side of mirror
    planes; inclined: keys and conditions of rollers and antisymmetric supports in regions with a name, whose surface
    may have any direction.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        scene: Scene,
        conditions: list[tuple[str, Condition]],
        particle_set: ParticleSet,
        without_images: frozenset[int] = frozenset(),
        half_bodies: frozenset[int] = frozenset(),
    ):
        """without_images: bodies whose operators end at a fixed plane; half_bodies: those whose operators end at every
        plane, where some of their components are held and all else is as without it. Raises SolverError on all ranks
        when a mirror plane cuts a body. Collective."""
        d = particle_set.position.shape[1]
        self.planes: list[MirrorPlane] = []
        self.ends: list[MirrorPlane] = []
        self.inclined: list[tuple[str, Support]] = []
        self.held = np.zeros((len(particle_set), d), bool)
        for key, one in conditions:
            if not isinstance(one, Support):
                continue
            if one.plane is None and one.kind != "fixed":
                self.inclined.append((key, one))
                continue
            here = selected(scene, one, particle_set, comm)
            if one.plane is None:
                self.held |= here[:, None]
                continue
            plane = mirror_plane(scene, one)
            if one.mirror:
                check_sides(comm, plane, particle_set, key)
                ends = half_bodies | without_images if plane.kind == "fixed" else half_bodies
                self.planes += _with_images(plane, ends, len(scene.bodies))
                self.ends += [replace(plane, body=i) for i in sorted(half_bodies) if plane.body in (None, i)]
                # cell-centred particles beside the plane move; their images hold them
                here &= plane.contains(particle_set)
            self.held |= here[:, None] & plane.held(d)
        self.codes: MirrorCodes | None = mirror_codes(comm, self.planes, particle_set)
        on_planes = sum((plane.contains(particle_set).astype(float) for plane in self.planes), np.zeros(len(self.held)))
        self.share: np.ndarray = 0.5**on_planes


def _with_images(plane: MirrorPlane, without_images: frozenset[int], bodies: int) -> list[MirrorPlane]:
    """A plane once for all bodies, or once for each body that has images there."""
    if not without_images:
        return [plane]
    return [replace(plane, body=i) for i in range(bodies) if i not in without_images and plane.body in (None, i)]


class InclinedRoller:
    """Particles of a surface that do not move along ("roller") or across ("antisymmetric") its reference normal."""

    def __init__(self, one: Support, surface: Surface, particle_set: ParticleSet, held: np.ndarray, number: int):
        """held (n, d, d): projections on directions that other supports hold; this one's directions are added."""
        self.condition, self.surface = one, surface
        rows, (n, d) = surface.selection.rows, held.shape[:2]
        normals = surface.normals_at_start(particle_set)[rows]
        wanted = [normals]
        if one.kind == "antisymmetric":
            wanted = [np.eye(d)[i] - normals[:, i, None] * normals for i in range(d)]
        directions = np.zeros((n, len(wanted), d))
        for k, vectors in enumerate(wanted):
            # at an edge with two normals the second one is held as far as the first does not hold it
            rest = vectors - np.einsum("kij,kj->ki", held[rows], vectors)
            length = np.linalg.norm(rest, axis=1)[:, None]
            directions[rows, k] = np.where(length > _PARALLEL, rest / np.maximum(length, _PARALLEL), 0.0)
            held[rows] += directions[rows, k, :, None] * directions[rows, k, None, :]
        self._shape, self._name = (len(wanted), d), f"held_directions_{number}"
        surface.particles.declare(Field(self._name, len(wanted) * d, "1"), directions.reshape(n, len(wanted) * d))

    @property
    def rows(self) -> np.ndarray:
        """Rows (k,) of this rank's particles."""
        return self.surface.selection.rows

    def held(self, vectors: np.ndarray) -> np.ndarray:
        """The part of vectors (d, k) of its particles along directions that it holds."""
        directions = self.surface.particles.owned_rows(self._name)[self.rows].reshape(-1, *self._shape)
        return np.einsum("kmi,kmj,jk->ik", directions, directions, vectors)


def inclined_rollers(
    comm: MPI.Comm, scene: Scene, supports: Supports, particle_set: ParticleSet, particles: Particles
) -> list[InclinedRoller]:
    """Those of a scene; particles: those of the particle set. Collective."""
    projections: Any = supports.held[:, :, None] * np.eye(scene.dimension)
    return [
        InclinedRoller(one, Surface(comm, scene, key, one, particle_set, particles), particle_set, projections, i)
        for i, (key, one) in enumerate(supports.inclined)
    ]
