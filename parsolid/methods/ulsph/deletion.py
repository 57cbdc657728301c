"""Failed particles that are deleted: they keep a trifle of their mass and stand still, so that no neighbour feels them.

Ghosts hear of masses only when lists are made, so particles go at the start of the step after they failed, when all
ranks make them. The half kick of that step still is by forces of their whole mass: they go behind it, so that action
and reaction are booked both. Until then the mass that is due is a negative `deleted_mass`.
"""

from typing import Any

import numpy as np

from parsolid.methods.failed_matter import failed_to_delete, note_deleted
from parsolid.methods.failure_fields import DELETED_KINETIC, DELETED_STORED

# of the mass that stays, so that sums over neighbours are divided by something
_LEFT = 1e-12


class Deletion:
    """Of one rank's particles; energies [J] of what has gone are asked for with `taken`."""

    def __init__(self, system: Any):
        """system: `system.UpdatedLagrangianSPH`, whose fields are declared."""
        self.system, self.particles = system, system.particles
        self.possible = "deleted_mass" in self.particles
        self._energies: dict[str, float] = {}

    def due(self) -> bool:
        """Whether this rank has failed particles to delete."""
        return self.possible and len(failed_to_delete(self.particles, self.system.blocks)) > 0

    def announce(self) -> None:
        """Before lists are made: masses of particles that will go, as ghosts shall know them."""
        if self.possible:
            rows = failed_to_delete(self.particles, self.system.blocks)
            mass = self.particles.owned_rows("mass")
            self.particles.owned_rows("deleted_mass")[rows] = -(1.0 - _LEFT) * mass[rows]
            mass[rows] *= _LEFT

    def give_back(self) -> None:
        """After lists were made: this rank's own particles have their masses once more."""
        if self.possible:
            deleted = self.particles.owned_rows("deleted_mass")
            self.particles.owned_rows("mass")[:] -= np.minimum(deleted, 0.0)

    def carry_out(self) -> None:
        """Between half kick and first pass: what is due goes, and what has gone stands still."""
        if not self.possible:
            return
        particles = self.particles
        rows = np.flatnonzero(particles.owned_rows("deleted_mass") < 0.0)
        if len(rows):
            before = self.system.energies()
            mass, velocity = -particles.owned_rows("deleted_mass")[rows], particles.owned_rows("velocity")[rows].copy()
            note_deleted(particles, rows, mass, velocity)
            # those of its whole mass, whose heat the next state would take in
            particles.owned_rows("force_sums")[rows] = 0.0
            self.hold()
            after = self.system.energies()
            self._energies = {DELETED_KINETIC: before[0] - after[0], DELETED_STORED: before[1] - after[1]}
        else:
            self.hold()

    def hold(self) -> None:
        """Take the mass and the motion of deleted particles; also after a restart, whose masses are those of time 0."""
        if self.possible:
            gone = np.flatnonzero(self.particles.owned_rows("deleted_mass") > 0.0)
            left = self.particles.owned_rows("deleted_mass")[gone] * _LEFT / (1.0 - _LEFT)
            self.particles.owned_rows("mass")[gone] = left
            self.particles.owned_rows("velocity")[gone] = 0.0

    def taken(self) -> dict[str, float]:
        """Energies [J] that went with particles since this was asked."""
        result, self._energies = self._energies, {}
        return result
