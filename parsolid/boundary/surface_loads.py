"""Forces on surfaces that follow the motion, or act on the reference: pressure, springs and dashpots, tractions."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import (
    Declarations,
    Declared,
    RegionTraction,
    SurfacePressure,
    SurfaceSpring,
    SurfaceTraction,
)
from parsolid.boundary.reactions import Told
from parsolid.boundary.surfaces import Surface
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet

# of the largest stable step of a spring or dashpot on its own
_SAFETY = 0.8
# what `SurfaceLoads` makes forces of
TAKES = (SurfaceTraction, RegionTraction, SurfacePressure, SurfaceSpring)


class Pressed:
    """Pressure on the present area, cof(F) dA."""

    def __init__(self, one: SurfacePressure, surface: Surface):
        self.one, self.surface, self.particles = one, surface, surface.particles
        self._areas = np.zeros((0, 1))

    def look(self) -> None:
        """Keep the present areas."""
        rows, d = self.surface.chosen.rows, self.particles.owned_rows("position").shape[1]
        F = self.particles.owned_rows("deformation_gradient")[rows, : d * d].reshape(-1, d, d)
        A = self.surface.vectors(rows)
        if d == 2:
            cofactor = np.empty_like(F)
            cofactor[:, 0, 0], cofactor[:, 0, 1] = F[:, 1, 1], -F[:, 1, 0]
            cofactor[:, 1, 0], cofactor[:, 1, 1] = -F[:, 0, 1], F[:, 0, 0]
        else:
            cofactor = np.cross(F[:, (1, 2, 0)], F[:, (2, 0, 1)])
        self._areas = np.einsum("kij,kj->ki", cofactor, A)

    def forces(self, time: float, before: bool) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) and forces (k, d) [N] at a time [s], of a jump just after, or just before it."""
        rows = self.surface.chosen.rows
        if len(self._areas) != len(rows):
            self.look()
        places = np.ascontiguousarray(self.particles.owned_rows("reference_position")[rows])
        return rows, -self.one.course.evaluate(places, time, before) * self._areas

    @property
    def largest_step(self) -> float:
        """Pressure bounds no step."""
        return np.inf


class Sprung:
    """Springs and dashpots to rest."""

    def __init__(self, one: SurfaceSpring, surface: Surface, mass: Any):
        """mass(rows) [kg]: tributary."""
        self.one, self.surface, self.particles, self.mass = one, surface, surface.particles, mass

    def look(self) -> None:
        """Nothing to keep: x and v are those of the stage."""

    def forces(self, time: float, before: bool) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) and forces (k, d) [N]."""
        rows, of = self.surface.chosen.rows, self.particles.owned_rows
        moved = of("position")[rows] - of("reference_position")[rows]
        traction = -self.one.stiffness * moved - self.one.damping * of("velocity")[rows]
        if self.one.normal:
            normal = self.surface.normals(rows)
            traction = (traction * normal).sum(axis=1)[:, None] * normal
        return rows, traction * self.surface.areas(rows)[:, None]

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] of the particles' mass on springs and dashpots alone."""
        rows = self.surface.chosen.rows
        share = self.surface.areas(rows) / self.mass(rows)
        rate = np.sqrt(self.one.stiffness * share) + self.one.damping * share
        return float(_SAFETY * 1.7 / rate.max(initial=1e-300))


class Pulled:
    """A traction per reference area."""

    def __init__(self, one: SurfaceTraction | RegionTraction, surface: Surface):
        self.one, self.surface, self.particles = one, surface, surface.particles

    def look(self) -> None:
        """Nothing to keep."""

    def forces(self, time: float, before: bool) -> tuple[np.ndarray, np.ndarray]:
        """Rows (k,) and forces (k, d) [N] at a time [s], of a jump just after, or just before it."""
        rows = self.surface.chosen.rows
        places = np.ascontiguousarray(self.particles.owned_rows("reference_position")[rows])
        return rows, self.one.course.evaluate(places, time, before) * self.surface.areas(rows)[:, None]

    @property
    def largest_step(self) -> float:
        """Tractions bound no step."""
        return np.inf


class SurfaceLoads:
    """All of them of methods whose particles are whole and carry their mass; `told`: those that tell their force.

    landings [s]: at which they jump, before the end.
    """

    def __init__(self, declared: Declarations, comm: MPI.Comm, particles: Particles, particle_set: ParticleSet):
        """particles: those of the particle_set, with their mass; collective."""
        self.particles, self.dimension = particles, declared.dimension

        def mass(rows: np.ndarray) -> np.ndarray:
            return np.asarray(particles.owned_rows("mass")[rows])

        self.loads: list[Pulled | Pressed | Sprung] = []
        for one in declared.all:
            if isinstance(one, TAKES):
                surface = Surface(comm, declared, one, particle_set, particles)
                self.loads.append(_load(one, surface, mass))
        courses = [load.one.course for load in self.loads if not isinstance(load, Sprung)]
        times = {time for course in courses for time in course.jump_times}
        self.landings = tuple(sorted(time for time in times if 0.0 < time < declared.scene.end_time))
        self._told = {id(load): Told(load.one, declared.dimension) for load in self.loads if load.one.where.reports}
        self.told = list(self._told.values())
        self._forces: list[tuple[Any, np.ndarray, np.ndarray]] = []

    @property
    def acting(self) -> bool:
        """Whether there are any, the same on all ranks."""
        return bool(self.loads)

    def add_to(self, forces: np.ndarray, time: float) -> None:
        """Add those of a time [s] to forces (owned or more, d or more) [N] on particles."""
        self._forces = []
        for load in self.loads:
            load.look()
            rows, found = load.forces(time, False)
            forces[rows, : self.dimension] += found
            if id(load) in self._told:
                self._forces.append((self._told[id(load)], rows, found))

    def tell(self, duration: float, moved: np.ndarray) -> None:
        """Count the impulses of the forces that were added last, over a duration [s] in which particles have moved by
        (owned, d) [m]."""
        places = self.particles.owned_rows("position")
        for told, rows, found in self._forces:
            told.take(places[rows], duration * found, float(np.sum(found * moved[rows])))

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] of springs and dashpots of this rank."""
        return min((load.largest_step for load in self.loads), default=np.inf)


def _load(one: Declared, surface: Surface, mass: Any) -> Pulled | Pressed | Sprung:
    if isinstance(one, SurfaceTraction | RegionTraction):
        return Pulled(one, surface)
    if isinstance(one, SurfacePressure):
        return Pressed(one, surface)
    assert isinstance(one, SurfaceSpring)
    return Sprung(one, surface, mass)
