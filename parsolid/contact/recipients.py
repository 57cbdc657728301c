"""The particles of a system on which contact acts: their forces are part of those that their integrator takes."""

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.contact.list_kernels import give_to_rows, hand_over, start_anew
from parsolid.contact.lists import Entries
from parsolid.methods.protocol import ParticleSystem


class Recipient:
    """Rows (k,) of a system's particles that have entries; forces (2, k, d) [N], on whole particles: in the present
    places, and what the impulse of the last step has besides where a gap has opened or closed in it (`crossing`)."""

    def __init__(self, system: ParticleSystem, number: int, entries: Entries) -> None:
        """number: of the system in the entries' segments."""
        here = [one for one in entries.segments if one.system == number]
        owned, empty = system.particles.owned_rows, np.zeros(0, np.int64)
        self.system = system
        self.rows, number_of = np.unique(np.concatenate([empty, *(one.rows for one in here)]), return_inverse=True)
        self.entry = np.concatenate([empty, *(np.arange(one.first, one.last) for one in here)])
        self.recipient = np.ascontiguousarray(number_of.reshape(-1))
        self.forces = np.zeros((2, len(self.rows), system.dimension))
        self.forces[0] = owned("contact_force")[self.rows]
        self.crossing = False
        self.share = np.ascontiguousarray(system.share[: system.owned][self.rows])
        part = entries.share[self.entry] / self.share[self.recipient]
        # of entries, what they feel over what counts of their particles, where planes are not those of both bodies
        self.part = part if (part != 1.0).any() else None
        # rows of earlier lists may still show a force
        self._clean = False

    def resume(self, force: np.ndarray) -> None:
        """Take the forces (k, d) [N] of a checkpoint for those of the present places."""
        self.forces[0] = force
        give_to_rows(force, self.rows, self.system.particles.owned_rows("contact_force"))

    def take(self, force: np.ndarray, extra: np.ndarray | None) -> None:
        """Forces (entries, d) [N] in new places, and what the impulse has besides, None without any."""
        owned = self.system.particles.owned_rows
        shown, start, position = owned("contact_force"), owned("contact_start"), owned("position")
        if not self._clean:
            shown[:], self._clean = 0.0, True
        self.crossing = extra is not None
        hand_over(self.entry, self.recipient, self.part, force, extra, self.forces)
        start_anew(self.rows, self.forces[0], position, shown, start)

    def give(self, step: float) -> None:
        """Add the forces to those on the particles, and the impulse that a step [s] has besides."""
        if not len(self.rows):
            return
        owned = self.system.particles.owned_rows
        owned(EXTERNAL_FORCE)[self.rows] += self.share[:, None] * self.forces[0]
        if self.crossing and step > 0.0:
            owned(EXTERNAL_IMPULSE)[self.rows] += 0.5 * step * self.share[:, None] * self.forces[1]

    def warm(self, heat: np.ndarray) -> float:
        """Give the particles what their entries (entries,) have of heat [J]; what of it the stored energy holds [J]."""
        mine = heat[self.entry] if self.part is None else heat[self.entry] * self.part
        taken = np.bincount(self.recipient, mine, minlength=len(self.rows))
        warmed = np.flatnonzero(taken)
        return self.system.take_heat(taken[warmed], self.rows[warmed])
