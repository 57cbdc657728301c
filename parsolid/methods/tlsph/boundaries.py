"""Boundaries and loads of a scene as the momentum equation of total-Lagrangian SPH takes them."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import (
    Declarations,
    Declared,
    HeldRegion,
    PrescribedMotion,
    RegionTraction,
    Support,
    SurfacePressure,
    SurfaceSpring,
    SurfaceTraction,
)
from parsolid.boundary.loads import Load, accelerations, densities
from parsolid.boundary.prescribed import NotFree, PrescribedRows
from parsolid.boundary.rows import OfRows, keep
from parsolid.boundary.supports import Supports
from parsolid.boundary.surfaces import Surface
from parsolid.collective import anywhere
from parsolid.methods.tlsph import momentum as motion
from parsolid.methods.tlsph.reactions import Reactions, Taken
from parsolid.methods.tlsph.reporting import reactions_of
from parsolid.methods.tlsph.surface_forces import SurfaceForces
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.schema import Scene


class BoundarySet:
    """What the momentum equation needs of a scene's boundaries and loads.

    planes, codes, share: see `boundary.supports.Supports`; jump_times [s]: at which loads or prescribed motions jump.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        declared: Declarations,
        particle_set: ParticleSet,
        particles: Particles,
        closed: frozenset[int] = frozenset(),
    ):
        """particles: those of the particle_set; closed: see `Supports`; collective."""
        supports = Supports(comm, declared.scene, declared.of(Support), declared.of(HeldRegion), particle_set, closed)
        self.planes, self.codes, self.share = supports.planes, supports.codes, supports.share
        self.particles = particles
        self._clamp = _clamp(comm, supports.held, particles)
        density = densities(declared.scene, particles)
        self.surfaces = None
        if any(isinstance(one, HeldRegion | SurfacePressure | SurfaceSpring) for one in declared.all):
            self.surfaces = SurfaceForces(declared, comm, particles, particle_set, density, supports.held)
        self.prescribed = PrescribedRows(
            comm, declared.scene, declared.of(PrescribedMotion, "velocity"), particle_set, particles
        )
        pulled = [one for one in declared.all if isinstance(one, SurfaceTraction | RegionTraction)]
        tractions = {one.key: _traction(comm, declared, one, particle_set, particles) for one in pulled}
        self.loads = accelerations(declared.scene, particles, *tractions.values())
        self.reactions: Reactions | None = reactions_of(comm, declared, particle_set, self, tractions)
        courses: list[Any] = [one.course for one in declared.of(PrescribedMotion)]
        courses += [one.course for one in pulled]
        times = {*declared.scene.loads.jump_times}.union(*(course.jump_times for course in courses))
        self.jump_times = tuple(sorted(time for time in times if 0.0 < time < declared.scene.end_time))
        motions = declared.of(PrescribedMotion)
        self.turned = [(one, one.turn) for one in motions if one.turn is not None]
        self.held_energy = 0.0
        self.not_free = NotFree(particles, self.prescribed, lambda: self.clamp)

    @property
    def clamp(self) -> np.ndarray | None:
        """Multipliers (n, 4) of velocities, None where no rank holds any."""
        # the same array at every call, for `Recalled`
        return None if self._clamp is None else self.particles.owned_rows("clamp")

    @property
    def free(self) -> np.ndarray | None:
        """Multipliers (n, 4) of accelerations, 0 also where the motion is prescribed; None where no rank has any."""
        return self.particles.owned_rows("free") if "free" in self.particles else self.clamp

    def declare_free(self) -> None:
        """Particles carry `free` where it is not `clamp`."""
        if self.prescribed.guided:
            free = np.ones((self.particles.owned, 4)) if self.clamp is None else self.clamp.copy()
            free[self.prescribed.entries] = 0.0
            keep(self.particles, "free", free)

    def look(self) -> None:
        """Keep what loads need of the present strain."""
        if self.surfaces is not None:
            self.surfaces.look()

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] of springs and dashpots of this rank."""
        return np.inf if self.surfaces is None else self.surfaces.largest_step

    def loads_at(self, time: float, before: bool = False) -> np.ndarray | None:
        """Accelerations (n, 4) of body forces and tractions [m/s^2], of a jump just after, or just before it; None
        without loads."""
        loads = self.loads.at(time, before) if self.loads.acting else None
        return loads if self.surfaces is None else self.surfaces.added(loads, time, before)

    def meet(self, time: float, before: bool, force: np.ndarray, mass: np.ndarray, share: np.ndarray) -> Any:
        """Loads as `loads_at`, for pair forces (n, 8) to which is added what slides hold, and what conditions that tell
        their forces take then."""
        loads = self.loads_at(time, before)
        dimension = self.particles.owned_rows("position").shape[1]
        supports = [] if self.surfaces is None else self.surfaces.support(force, mass, loads, dimension)
        if self.reactions is not None:
            self.reactions.find(Taken(force, mass, share, loads, supports, time, before))
        return loads, supports

    def prescribe(self, time: float, kinematics: np.ndarray, before: bool = False) -> None:
        """Set prescribed velocity components to their values at a time [s], after or before a jump of that time."""
        if self.prescribed.guided:
            motion.prescribe(*self.prescribed.entries, self.prescribed.values("velocity", time, before), kinematics)

    def place(self, time: float) -> None:
        """Particles that turn about an axis, exactly where they are at a time [s]."""
        for one, turn in self.turned:
            rows, components = self.prescribed.of(one)
            start, now = (self.particles.owned_rows(name) for name in ("reference_position", "position"))
            there = np.ascontiguousarray(start[rows])
            now[rows] = np.where(components, there + turn.evaluate(there, time), now[rows])

    def prescribe_mean(self, time: float, step: float, kinematics: np.ndarray) -> None:
        """Set prescribed velocity components to their mean over a step [s] from a time [s], by Simpson's rule."""
        if self.prescribed.guided:
            first, middle = (self.prescribed.values("velocity", time + part * step) for part in (0.0, 0.5))
            last = self.prescribed.values("velocity", time + step, step > 0.0)
            motion.prescribe(*self.prescribed.entries, (first + 4.0 * middle + last) / 6.0, kinematics)

    def prescribed_power(
        self,
        kinematics: np.ndarray,
        force: np.ndarray,
        mass: np.ndarray,
        share: np.ndarray,
        loads: np.ndarray | None,
    ) -> float:
        """Power [W] against pair forces and loads; see `momentum.prescribed_power`."""
        if not self.prescribed.guided:
            return 0.0
        return float(motion.prescribed_power(*self.prescribed.entries, kinematics, force, mass, share, loads))

    def prescribed_energy_gain(self, kinematics: np.ndarray, mass: np.ndarray, share: np.ndarray) -> float:
        """Kinetic energy [J] that prescribed components gained since the last call."""
        if not self.prescribed.guided:
            return 0.0
        particles, components = self.prescribed.entries
        energy = float(np.sum(0.5 * mass[particles] * share[particles] * kinematics[particles, components] ** 2))
        gain, self.held_energy = energy - self.held_energy, energy
        return gain


def build_boundaries(
    comm: MPI.Comm,
    scene: Scene,
    particle_set: ParticleSet,
    particles: Particles,
    closed: frozenset[int] = frozenset(),
) -> BoundarySet:
    """Boundaries and loads of a scene for this rank's particle_set; collective.

    particles: those of the particle_set; closed: see `Supports`. Raises SolverError on all ranks when a
    mirror plane cuts a body or the method cannot do what a condition means.
    """
    declared = Declarations(
        scene,
        Support,
        HeldRegion,
        PrescribedMotion,
        SurfaceTraction,
        RegionTraction,
        SurfacePressure,
        SurfaceSpring,
    )
    return BoundarySet(comm, declared, particle_set, particles, closed)


def _traction(
    comm: MPI.Comm, declared: Declarations, one: Declared, particle_set: ParticleSet, particles: Particles
) -> Load:
    """Traction [Pa] times tributary area over tributary mass."""
    assert isinstance(one, SurfaceTraction | RegionTraction)
    surface, density = Surface(comm, declared, one, particle_set, particles), densities(declared.scene, particles)

    def scale(rows: np.ndarray | slice) -> np.ndarray:
        return np.asarray(surface.areas(rows) / (density(rows) * particles.owned_rows("volume")[rows]))

    return Load(particles, surface.chosen, scale, one.course)


def _clamp(comm: MPI.Comm, held: np.ndarray, particles: Particles) -> OfRows | None:
    """Multipliers (n, 4), 0 for held components (n, d), else 1; None when no rank holds any."""
    if not anywhere(comm, bool(held.any())):
        return None
    clamp = np.ones((len(held), 4))
    clamp[:, : held.shape[1]][held] = 0.0
    return keep(particles, "clamp", clamp)
