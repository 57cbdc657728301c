"""Forces on surfaces that follow the motion: pressure, springs and dashpots, and slides, which hold a normal."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import Declarations, Declared, HeldRegion, SurfacePressure, SurfaceSpring
from parsolid.boundary.rows import keep
from parsolid.boundary.surface_loads import Pressed, Sprung
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


class SurfaceForces:
    """All of them on a rank's particles; loads: those with a force, by the declaration."""

    def __init__(
        self,
        declared: Declarations,
        comm: MPI.Comm,
        particles: Particles,
        particle_set: ParticleSet,
        density: Any,
        clamped: np.ndarray,
    ):
        """density(rows) [kg/m^3]; clamped (n, d) bool: components that are held anyway; collective."""
        self.particles = particles

        def mass(rows: np.ndarray) -> np.ndarray:
            return np.asarray(density(rows) * particles.owned_rows("volume")[rows])

        def surface(one: Declared) -> Surface:
            return Surface(comm, declared, one, particle_set, particles)

        self.mass = mass
        self.loads: list[Pressed | Sprung] = [Pressed(one, surface(one)) for one in declared.of(SurfacePressure)]
        self.loads += [Sprung(one, surface(one), mass) for one in declared.of(SurfaceSpring)]
        held = [one for one in declared.of(HeldRegion) if one.kind != "fixed"]
        projections = clamped[:, :, None] * np.eye(declared.dimension)
        self.slides = [Slide(one, surface(one), particle_set, projections, i) for i, one in enumerate(held)]

    def look(self) -> None:
        """Keep what loads need of the present strain."""
        for load in self.loads:
            load.look()

    def added(self, loads: np.ndarray | None, time: float, before: bool) -> np.ndarray | None:
        """Accelerations (n, 4) [m/s^2] with those of these loads."""
        if not self.loads:
            return loads
        result = np.zeros((self.particles.owned, 4)) if loads is None else loads.copy()
        for load in self.loads:
            rows, forces = load.forces(time, before)
            result[rows, : forces.shape[1]] += forces / self.mass(rows)[:, None]
        return result

    def stop(self, velocity: np.ndarray) -> None:
        """Take from velocities (n, d) what slides hold."""
        for slide in self.slides:
            velocity[slide.rows] -= slide.held(velocity[slide.rows])

    def support(self, force: np.ndarray, mass: np.ndarray, loads: np.ndarray | None, d: int) -> list[np.ndarray]:
        """Add to pair forces (n, 8) what holds the particles of slides, of whole particles; returns it (k, d) [N]."""
        result = []
        for slide in self.slides:
            rows = slide.rows
            resisted = force[rows, :d] + force[rows, 4 : 4 + d]
            if loads is not None:
                resisted = resisted + mass[rows, None] * loads[rows, :d]
            result.append(-slide.held(resisted))
            force[rows, :d] += result[-1]
        return result

    def release(self, force: np.ndarray, supports: list[np.ndarray]) -> None:
        """Take back what `support` added."""
        for slide, held in zip(self.slides, supports):
            force[slide.rows, : held.shape[1]] -= held

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] of springs and dashpots of this rank."""
        return min((load.largest_step for load in self.loads), default=np.inf)
