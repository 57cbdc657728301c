"""Slides: particles of a surface that do not move along its normal, or across it, of any direction."""

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import Declarations, HeldRegion
from parsolid.boundary.rows import keep
from parsolid.boundary.surfaces import Surface
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet

# length of what is left of a direction that another condition holds
_PARALLEL = 1e-6


class Slide:
    """Particles of a surface that do not move along ("roller") or across ("antisymmetric") its reference normal."""

    def __init__(self, one: HeldRegion, surface: Surface, particle_set: ParticleSet, held: np.ndarray, number: int):
        """held (n, d, d): projections on what other conditions hold, to which this one's directions are added."""
        self.one, self.surface = one, surface
        rows, (n, d) = surface.chosen.rows, held.shape[:2]
        normals = surface.normals_of(particle_set)[rows]
        wanted = [normals]
        if one.kind == "antisymmetric":
            wanted = [np.eye(d)[i] - normals[:, i, None] * normals for i in range(d)]
        directions = np.zeros((n, len(wanted), d))
        for k, vectors in enumerate(wanted):
            # of two normals at an edge the second is held as far as the first does not
            rest = vectors - np.einsum("kij,kj->ki", held[rows], vectors)
            length = np.linalg.norm(rest, axis=1)[:, None]
            directions[rows, k] = np.where(length > _PARALLEL, rest / np.maximum(length, _PARALLEL), 0.0)
            held[rows] += directions[rows, k, :, None] * directions[rows, k, None, :]
        self._shape = len(wanted), d
        self._directions = keep(surface.particles, f"slide_{number}", directions.reshape(n, -1))

    @property
    def rows(self) -> np.ndarray:
        """Rows (k,) of this rank's particles."""
        return self.surface.chosen.rows

    def held(self, vectors: np.ndarray) -> np.ndarray:
        """What of vectors (k, d) of the rows is held."""
        directions = self._directions(self.rows).reshape(-1, *self._shape)
        return np.einsum("kmi,kmj,kj->ki", directions, directions, vectors)


def slides_of(
    comm: MPI.Comm, declared: Declarations, particle_set: ParticleSet, particles: Particles, clamped: np.ndarray
) -> list[Slide]:
    """Those of a scene; particles: those of the particle_set; clamped (n, d) bool: components that are held anyway;
    collective."""
    held = [one for one in declared.of(HeldRegion) if one.kind != "fixed"]
    projections = clamped[:, :, None] * np.eye(declared.dimension)
    surfaces = [Surface(comm, declared, one, particle_set, particles) for one in held]
    pairs = zip(held, surfaces)
    return [Slide(one, surface, particle_set, projections, i) for i, (one, surface) in enumerate(pairs)]
