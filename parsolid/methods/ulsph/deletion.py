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


def _left_of(deleted: np.ndarray) -> np.ndarray:
    """Masses [kg] that stay of deleted ones, the same bits for owners, ghosts and after a restart."""
    return deleted * _LEFT / (1.0 - _LEFT)


class Deletion:
    """Of one rank's particles; energies [J] of what has gone are asked for with `taken`."""

    def __init__(self, system: Any):
        """system: `system.UpdatedLagrangianSPH`, whose fields are declared."""
        self.system, self.particles = system, system.particles
        self._energies: dict[str, float] = {}

    def due(self) -> bool:
        """Whether this rank has failed particles to delete."""
        return len(failed_to_delete(self.particles, self.system.blocks)) > 0

    def __enter__(self) -> None:
        """Before lists are made: masses of particles that will go, as ghosts shall know them."""
        rows = failed_to_delete(self.particles, self.system.blocks)
        mass = self.particles.owned_rows("mass")
        going = (1.0 - _LEFT) * mass[rows]
        self.particles.owned_rows("deleted_mass")[rows] = -going
        mass[rows] = _left_of(going)

    def __exit__(self, *error: object) -> None:
        """After lists were made: this rank's own particles have their masses once more."""
        deleted = self.particles.owned_rows("deleted_mass")
        self.particles.owned_rows("mass")[:] -= np.minimum(deleted, 0.0)

    def carry_out(self) -> None:
        """Between half kick and first pass: what is due goes, and what has gone stands still."""
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
        """Take the mass and the motion of deleted particles."""
        self.lighten()
        self.particles.owned_rows("velocity")[self.particles.owned_rows("deleted_mass") > 0.0] = 0.0

    def lighten(self) -> None:
        """Take the mass of deleted particles; also after a restart, whose masses are those of time 0."""
        gone = self.particles.owned_rows("deleted_mass") > 0.0
        self.particles.owned_rows("mass")[gone] = _left_of(self.particles.owned_rows("deleted_mass")[gone])

    def taken(self) -> dict[str, float]:
        """Energies [J] that went with particles since this was asked."""
        result, self._energies = self._energies, {}
        return result
