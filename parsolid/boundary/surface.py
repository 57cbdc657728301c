"""The surface of bodies on which a condition acts: its particles, their areas and normals."""

import numpy as np
from mpi4py import MPI

from parsolid.collective import raise_together
from parsolid.particles.container import Particles, Selection
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import selected
from parsolid.scene.boundaries import Condition
from parsolid.scene.schema import Scene


class Surface:
    """The surface of bodies on a condition's plane, or in its region with a name."""

    def __init__(
        self,
        comm: MPI.Comm,
        scene: Scene,
        key: str,
        condition: Condition,
        particle_set: ParticleSet,
        particles: Particles,
    ):
        """particles: those of the particle set; key: the condition's place in the scene. Raises SolverError on all
        ranks where no particle has such a surface. Collective."""
        self.particles = particles
        self.axis = None if condition.plane is None else condition.plane.axis
        here = selected(scene, condition, particle_set, comm)
        if self.axis is None:
            assert condition.region_name is not None
            number, d = list(scene.named_regions).index(condition.region_name), scene.dimension
            # area vectors of a particle's surface, one vector after the other for each region with a name
            self._columns = slice(number * d, (number + 1) * d)
            assert particle_set.surfaces is not None
            here &= particle_set.surfaces[:, self._columns].any(axis=1)
        elif particle_set.area_across is not None:
            # nodes of meshes may be in the plane without a facet
            here &= particle_set.area_across[:, self.axis] != 0.0
        found = bool(comm.allreduce(int(here.any())))
        fault = f"{key}: expected a region with a part of the surface of a body, found none"
        raise_together(comm, None if found else fault)
        self.selection: Selection = particles.selection(here)

    def vectors(self, rows: np.ndarray | slice) -> np.ndarray:
        """Outward area vectors (k, d) [m^2] of the reference configuration."""
        name = "area_across" if "area_across" in self.particles else "area"
        return self._own(self.particles.owned_rows("surfaces" if self.axis is None else name)[rows])

    def _own(self, area: np.ndarray) -> np.ndarray:
        """The condition's part of area vectors: one component on a plane, some columns of a region."""
        if self.axis is None:
            return np.asarray(area[:, self._columns])
        result = np.zeros_like(area)
        result[:, self.axis] = area[:, self.axis]
        return result

    def areas(self, rows: np.ndarray | slice) -> np.ndarray:
        """Areas (k,) [m^2] of the reference configuration."""
        return np.asarray(np.linalg.norm(self.vectors(rows), axis=1))

    def normals(self, rows: np.ndarray | slice) -> np.ndarray:
        """Outward normals (k, d) of the reference configuration."""
        return _unit(self.vectors(rows))

    def normals_at_start(self, particle_set: ParticleSet) -> np.ndarray:
        """Outward normals (n, d) of a particle set; zero off the surface."""
        areas = np.asarray(particle_set.surfaces) if self.axis is None else particle_set.area_in_planes()
        return _unit(self._own(areas))


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors (k, d); zero where a vector is."""
    length = np.linalg.norm(vectors, axis=1)[:, None]
    return np.asarray(np.where(length > 0.0, vectors / np.where(length > 0.0, length, 1.0), 0.0))
