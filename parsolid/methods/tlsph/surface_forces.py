"""Forces on surfaces that follow the motion: pressure, springs and dashpots, and slides, which hold a normal."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import Declarations, Declared, SurfacePressure, SurfaceSpring
from parsolid.boundary.slides import slides_of
from parsolid.boundary.surface_loads import Pressed, Sprung
from parsolid.boundary.surfaces import Surface
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet


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
        self.slides = slides_of(comm, declared, particle_set, particles, clamped)

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
