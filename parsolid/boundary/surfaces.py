"""Surfaces of bodies that conditions speak of: their areas and normals, wherever their particles are."""

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import Declarations, Declared
from parsolid.boundary.rows import HasRows
from parsolid.collective import raise_together
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.regions import selected


class Surface:
    """The surface of bodies on a condition's plane, or in its region with a name."""

    def __init__(
        self, comm: MPI.Comm, declared: Declarations, one: Declared, particle_set: ParticleSet, particles: Particles
    ):
        """particles: those of the particle_set. Raises SolverError on all ranks for a region without surface.
        Collective."""
        self.particles, plane = particles, one.where.plane
        self._axis = None if plane is None else plane.axis
        chosen = selected(declared.scene, one.where, particle_set, comm)
        if plane is None:
            assert one.where.region_name is not None
            number, d = list(declared.scene.named_regions).index(one.where.region_name), declared.dimension
            self._columns = slice(number * d, (number + 1) * d)
            assert particle_set.surfaces is not None
            chosen &= particle_set.surfaces[:, self._columns].any(axis=1)
        there = bool(comm.allreduce(int(chosen.any())))
        fault = f"{one.key}: expected a region with a part of the surface of a body, found none"
        raise_together(comm, None if there else fault)
        self.chosen: HasRows = particles.selection(chosen)

    def vectors(self, rows: np.ndarray | slice) -> np.ndarray:
        """Outward area vectors (k, d) [m^2] of particles at rows."""
        name = "surfaces" if self._axis is None else "area"
        return self._own(self.particles.owned_rows(name)[rows])

    def _own(self, area: np.ndarray) -> np.ndarray:
        if self._axis is None:
            return np.asarray(area[:, self._columns])
        result = np.zeros_like(area)
        result[:, self._axis] = area[:, self._axis]
        return result

    def areas(self, rows: np.ndarray | slice) -> np.ndarray:
        """Areas (k,) [m^2] of particles at rows."""
        return np.asarray(np.linalg.norm(self.vectors(rows), axis=1))

    def normals_of(self, particle_set: ParticleSet) -> np.ndarray:
        """Outward normals (n, d) of the particles that are made, 0 off the surface."""
        vectors = self._own(particle_set.area if self._axis is not None else np.asarray(particle_set.surfaces))
        length = np.linalg.norm(vectors, axis=1)[:, None]
        return np.asarray(np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), 0.0))

    def normals(self, rows: np.ndarray | slice) -> np.ndarray:
        """Outward normals (k, d) of particles at rows."""
        vectors = self.vectors(rows)
        return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])
