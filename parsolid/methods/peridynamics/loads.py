"""Supports, prescribed motion and loads of a peridynamic scene on one rank's particles."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import (
    Declarations,
    HeldRegion,
    PrescribedMotion,
    RegionTraction,
    Support,
    SurfacePressure,
    SurfaceTraction,
)
from parsolid.boundary.loads import InTime, Load, body_loads, densities
from parsolid.boundary.prescribed import PrescribedRows
from parsolid.boundary.rows import Components
from parsolid.boundary.slides import slides_of
from parsolid.boundary.supports import Supports
from parsolid.collective import SolverError
from parsolid.methods.peridynamics.tractions import Tractions
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.schema import Scene


class PeridynamicLoads:
    """What a scene's boundaries and loads mean for peridynamics; arrays are of this rank's particles, d = dimension.

    planes, codes, share: see `boundary.supports.Supports`, share at the start; entries: particles and components (k,)
    of everything guided; jumps: times [s] before the end at which loads or prescribed displacements jump, with 0 where
    anything is loaded; loads_of: key of a condition -> its loads.
    Forces [N] are those on the part of a particle on this side of mirror planes.
    """

    def __init__(self, comm: MPI.Comm, scene: Scene, particle_set: ParticleSet, particles: Particles):
        """particle_set: this rank's sorted particles, of which the particles are made; collective.

        Raises SolverError on all ranks.
        """
        self.scene, self.particles = scene, particles
        taken = (Support, HeldRegion, PrescribedMotion, SurfaceTraction, RegionTraction, SurfacePressure)
        self.declared = Declarations(scene, *taken)
        held = self.declared.of(HeldRegion)
        supports = Supports(comm, scene, self.declared.of(Support, "roller", "fixed"), held, particle_set)
        self.planes, self.codes, self.share = supports.planes, supports.codes, supports.share
        self._held = Components(particles, supports.held)
        self.slides = slides_of(comm, self.declared, particle_set, particles, supports.held)
        if self.slides and scene.method.solution.kind != "explicit":
            expected = 'method.solution.kind = "explicit" for a normal that is held'
            raise SolverError(f"{self.slides[0].one.key}.kind: expected {expected}, found equilibrium")
        motions = self.declared.of(PrescribedMotion, "velocity", "displacement")
        self.prescribed = PrescribedRows(comm, scene, motions, particle_set, self.particles)
        free = ~supports.held
        free[self.entries] = False
        self._free = Components(particles, free)
        self.jumps = self._jump_times()
        self._tractions = Tractions(comm, self.declared, supports, particle_set, self.particles)
        self._body_loads = self._loads_of_bodies()
        self.loads_of: dict[str, list[Load]] = {}
        self.loads = InTime(self.particles, self._body_loads, free.shape[1])
        self.move, self.guided_velocities = self.prescribed.move, self.prescribed.velocities

    def _loads_of_bodies(self) -> list[Load]:
        density = densities(self.scene, self.particles)

        def volume(rows: np.ndarray | slice) -> np.ndarray:
            return self.particles.owned_rows("volume")[rows]

        return body_loads(self.scene, self.particles, volume, lambda rows: density(rows) * volume(rows))

    def _jump_times(self) -> tuple[float, ...]:
        motions = (one for one in self.declared.of(PrescribedMotion) if one.quantity == "displacement")
        acting = [one.course.jump_times for one in motions]
        acting += [one.course.jump_times for one in self.declared.of(SurfaceTraction)]
        acting += [one.course.jump_times for one in self.declared.of(SurfacePressure)]
        acting += [one.course.jump_times for one in self.declared.of(RegionTraction)]
        loads = self.scene.loads
        if loads.body_force is not None or loads.acceleration is not None:
            acting.append(loads.jump_times)
        times = {0.0} if acting else set()
        return tuple(sorted(time for time in times.union(*acting) if time < self.scene.end_time))

    def install_tractions(self, forces: Any) -> None:
        """Find the forces of tractions; forces: of `forces.build_forces`, all bonds whole; collective."""
        found = self._tractions.forces(forces)
        for key, load in found:
            self.loads_of.setdefault(key, []).append(load)
        parts = [*self._body_loads, *(load for _, load in found)]
        self.loads = InTime(self.particles, parts, self.free.shape[1])

    @property
    def held(self) -> np.ndarray:
        """Components (owned, d) at rest."""
        return self._held.mask

    def stop(self, velocity: np.ndarray) -> None:
        """Take from velocities (owned, d) [m/s] what is held."""
        velocity[self.held] = 0.0
        for slide in self.slides:
            velocity[slide.rows] -= slide.held(velocity[slide.rows])

    @property
    def free(self) -> np.ndarray:
        """Components (owned, d) that are neither held nor guided."""
        return self._free.mask

    @property
    def entries(self) -> tuple[np.ndarray, np.ndarray]:
        """Particles and components (k,) of everything guided."""
        return self.prescribed.entries

    @property
    def acting(self) -> bool:
        """Whether there is any load on any rank."""
        return self.loads.acting

    def external(self, time: float, before: bool = False) -> np.ndarray:
        """Forces (owned, d) [N] of all loads at a time [s], after or before a jump of that time; not to be changed."""
        return self.loads.at(time, before)
