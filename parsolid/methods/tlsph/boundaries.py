"""Boundaries and loads of a scene as the momentum equation of total-Lagrangian SPH takes them."""

from typing import Any

import numpy as np

from parsolid.boundary.declarations import Declarations, PrescribedMotion, Support, SurfaceTraction
from parsolid.boundary.loads import Load, accelerations, area_along, densities
from parsolid.boundary.prescribed import PrescribedRows
from parsolid.boundary.rows import FixedParticles
from parsolid.boundary.supports import Supports
from parsolid.collective import SolverError, anywhere
from parsolid.methods.tlsph import momentum as motion
from parsolid.scene.regions import selected


class BoundarySet:
    """What the momentum equation needs of a scene's boundaries and loads.

    planes, codes, share: see `boundary.supports.Supports`; clamp (n, 4): multipliers of velocities, None where no rank holds any.
    """

    def __init__(self, comm, declared: Declarations, particle_set, particles: Any):
        """particles: `Particles` or `FixedParticles` of the particle_set; collective."""
        supports = Supports(comm, declared, particle_set)
        self.planes, self.codes, self.share = supports.planes, supports.codes, supports.share
        self.clamp = _clamp(comm, supports.held)
        self.prescribed = PrescribedRows(comm, declared, particle_set, particles)
        tractions = (_traction(comm, declared, one, particle_set, particles) for one in declared.of(SurfaceTraction))
        self.loads = accelerations(declared.scene, particles, *tractions)
        self.held_energy = 0.0

    def loads_at(self, time: float) -> np.ndarray | None:
        """Accelerations (n, 4) of body forces and tractions [m/s^2]; None without loads."""
        return self.loads.at(time) if self.loads.acting else None

    def prescribe(self, time: float, kinematics: np.ndarray) -> None:
        """Set prescribed velocity components to their values at a time [s]."""
        if self.prescribed.guided:
            motion.prescribe(*self.prescribed.entries, self.prescribed.values("velocity", time), kinematics)

    def prescribed_power(self, kinematics, force, mass, share, loads) -> float:
        """Power [W] against pair forces and loads; see `momentum.prescribed_power`."""
        if not self.prescribed.guided:
            return 0.0
        return motion.prescribed_power(*self.prescribed.entries, kinematics, force, mass, share, loads)

    def prescribed_energy_gain(self, kinematics, mass, share) -> float:
        """Kinetic energy [J] that prescribed components gained since the last call."""
        if not self.prescribed.guided:
            return 0.0
        particles, components = self.prescribed.entries
        energy = float(np.sum(0.5 * mass[particles] * share[particles] * kinematics[particles, components] ** 2))
        gain, self.held_energy = energy - self.held_energy, energy
        return gain


def build_boundaries(comm, scene, particle_set, particles: Any = None) -> BoundarySet:
    """Boundaries and loads of a scene for this rank's particle_set; collective.

    particles: the `Particles` made of the particle_set; rows stay as they are unless given. Raises SolverError on all ranks when a
    mirror plane cuts a body or the method cannot do what a condition means.
    """
    declared = Declarations(scene, Support, PrescribedMotion, SurfaceTraction)
    for one in declared.of(PrescribedMotion):
        if one.quantity != "velocity":
            raise SolverError(f"{one.key}.kind: expected a velocity with this method, found {one.where.kind!r}")
    return BoundarySet(comm, declared, particle_set, particles or FixedParticles(particle_set))


def _traction(comm, declared: Declarations, one: SurfaceTraction, particle_set, particles: Any) -> Load:
    """Traction [Pa] times tributary area over tributary mass."""
    chosen = particles.selection(selected(declared.scene, one.where, particle_set, comm))
    area, density = area_along(particles, one.where.plane.axis), densities(declared.scene, particles)
    return Load(
        particles, chosen, lambda rows: area(rows) / (density(rows) * particles.owned_rows("volume")[rows]), one.course
    )


def _clamp(comm, held: np.ndarray) -> np.ndarray | None:
    """Multipliers (n, 4) of velocity components; None when no rank holds any."""
    if not anywhere(comm, held.any()):
        return None
    clamp = np.ones((len(held), 4))
    clamp[:, : held.shape[1]][held] = 0.0
    return clamp
