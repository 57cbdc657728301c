"""Failed particles that are deleted: they keep 1e-12 of their mass and stand still, so that no neighbour feels them.

Ghosts know masses since the list was made, so particles go in the step after they failed, at whose start all ranks make
lists anew. The opening kick of that step is still by forces of their whole mass: they go behind it, so that action and
reaction are both counted. Until then the mass that is due is a negative `deleted_mass`. They have drifted for half a
step when they stop, which their ghosts have not: lists are made anew once more before the next step.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from parsolid.methods.failed_matter import failed_to_delete, note_deleted
from parsolid.methods.failure_fields import DELETED_INTERNAL, DELETED_KINETIC

# share of the mass that stays, so that no sum over neighbours is divided by zero
_LEFT = 1e-12


def _left_of(deleted: np.ndarray) -> np.ndarray:
    """Masses [kg] that stay of deleted ones, the same bits for owners, ghosts and after a restart."""
    return deleted * _LEFT / (1.0 - _LEFT)


class Deletion:
    """Deletion of one rank's particles.

    astray: whether a particle was deleted since lists were made, so that its ghosts are not where it is.
    """

    def __init__(self, system: Any):
        """system: `system.UpdatedLagrangianSPH`, whose fields are declared."""
        self.system, self.particles = system, system.particles
        self._energies: dict[str, float] = {}
        self.astray = False

    @property
    def asks(self) -> bool:
        """Whether this rank needs a new list, to delete failed particles or to update ghosts of deleted ones."""
        return self.astray or len(failed_to_delete(self.particles, self.system.blocks)) > 0

    @contextmanager
    def announced(self) -> Iterator[None]:
        """While a list is made and ghosts take masses, give particles to be deleted the mass that will be left."""
        mass, deleted = self.particles.owned_rows("mass"), self.particles.owned_rows("deleted_mass")
        rows = failed_to_delete(self.particles, self.system.blocks)
        going = (1.0 - _LEFT) * mass[rows]
        deleted[rows], mass[rows] = -going, _left_of(going)
        yield
        # particles have changed their rows
        mass, deleted = self.particles.owned_rows("mass"), self.particles.owned_rows("deleted_mass")
        mass -= np.minimum(deleted, 0.0)
        self.astray = False

    def stop(self) -> None:
        """Before a drift: stop deleted particles, here and in ghosts."""
        self.particles.owned_rows("velocity")[self.particles.owned_rows("deleted_mass") > 0.0] = 0.0

    def carry_out(self) -> None:
        """Between the first drift and the first sweep: delete the particles that are due."""
        of = self.particles.owned_rows
        rows = np.flatnonzero(of("deleted_mass") < 0.0)
        if len(rows):
            self.astray = True
            kinetic, stored = self.system.energies()
            note_deleted(self.particles, rows, -of("deleted_mass")[rows], of("velocity")[rows].copy())
            # forces of the whole mass, whose heat the next state would take up
            for name in ("force", "viscous_force", "viscous_heat", "impulse_power"):
                of(name)[rows] = 0.0
            self.lighten()
            self.stop()
            self.system.conditions.masses_changed()
            left = self.system.energies()
            self._energies = {DELETED_KINETIC: kinetic - left[0], DELETED_INTERNAL: stored - left[1]}
        else:
            self.lighten()

    def lighten(self) -> None:
        """Take the mass of deleted particles; also after a restart, whose masses are those of time 0."""
        of = self.particles.owned_rows
        gone = of("deleted_mass") > 0.0
        of("mass")[gone] = _left_of(of("deleted_mass")[gone])

    def take_energies(self) -> dict[str, float]:
        """Energies [J] of the particles deleted since the last call."""
        result, self._energies = self._energies, {}
        return result
