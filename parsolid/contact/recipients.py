"""The particles of a system on which contact acts: they get its impulses, and those who guide them do its work."""

import numpy as np

from parsolid.contact.list_kernels import give_to_rows, hand_over, impulses, keep_velocities, start_anew
from parsolid.contact.lists import Entries
from parsolid.contact.swings import book_swings
from parsolid.methods.protocol import EnergyLedger, ParticleSystem


class Recipient:
    """Rows (k,) of a system's particles that have entries; forces (3, k, d) [N]: at the start and at the end of the
    step under way, and what the impulse at its end has besides, where `crossing`."""

    def __init__(self, system: ParticleSystem, number: int, entries: Entries) -> None:
        """number: of the system in the entries' segments."""
        here = [one for one in entries.segments if one.system == number]
        owned, empty = system.particles.owned_rows, np.zeros(0, np.int64)
        self.system = system
        self.rows, number_of = np.unique(np.concatenate([empty, *(one.rows for one in here)]), return_inverse=True)
        self.entry = np.concatenate([empty, *(np.arange(one.first, one.last) for one in here)])
        self.recipient = np.ascontiguousarray(number_of.reshape(-1))
        d = system.dimension
        self.forces = np.zeros((3, len(self.rows), d))
        self.forces[1] = owned("contact_force")[self.rows]
        self.crossing = False
        self.started = np.zeros((len(self.rows), 2 * d))
        self.share = np.ascontiguousarray(system.share[: system.owned][self.rows])
        part = entries.share[self.entry] / self.share[self.recipient]
        # of entries, what they feel over what counts of their particles, where planes are not those of both bodies
        self.part = part if (part != 1.0).any() else None
        held = system.held_components()
        self.held = None if held is None or not held[self.rows].any() else held[self.rows]
        # rows of earlier lists may still show a force
        self._clean = False

    def resume(self, force: np.ndarray) -> None:
        """Take the forces (k, d) [N] of a checkpoint for those of the present places."""
        self.forces[1] = force
        give_to_rows(force, self.rows, self.system.particles.owned_rows("contact_force"))

    def kick(self, step: float, ledger: EnergyLedger | None) -> None:
        """Half a step [s] of the forces; at its end with the ledger, for what steps do to energies by themselves."""
        if not len(self.rows):
            return
        system, opening = self.system, ledger is None
        owned = system.particles.owned_rows
        if opening and system.verlet is not None:
            keep_velocities(self.rows, owned("velocity"), owned("contact_start"))
        if step == 0.0:
            return
        more = None if opening or not self.crossing else self.forces[2]
        rows, impulse = impulses(self.rows, self.forces[1], more, self.share, 0.5 * step)
        if len(rows):
            (system.kick_before if opening else system.kick)(impulse, rows)
        if ledger is not None and system.verlet is not None:
            book_swings(ledger, system, self.rows, step, self.forces, self.held, self.started)

    def warm(self, heat: np.ndarray) -> float:
        """Give the particles what their entries (entries,) have of heat [J]; what of it the stored energy holds [J]."""
        mine = heat[self.entry] if self.part is None else heat[self.entry] * self.part
        taken = np.bincount(self.recipient, mine, minlength=len(self.rows))
        warmed = np.flatnonzero(taken)
        return self.system.take_heat(taken[warmed], self.rows[warmed])

    def take(self, force: np.ndarray, extra: np.ndarray | None) -> float:
        """Forces (entries, d) [N] in new places; the work [J] of those who guide particles since the last places."""
        owned = self.system.particles.owned_rows
        shown, start, position = owned("contact_force"), owned("contact_start"), owned("position")
        if not self._clean:
            shown[:], self._clean = 0.0, True
        self.crossing = extra is not None
        hand_over(self.entry, self.recipient, self.part, force, extra, self.forces)
        start_anew(self.rows, self.forces[1], position, shown, start, self.started)
        if self.held is None:
            return 0.0
        moved = position[self.rows] - self.started[:, : position.shape[1]]
        moved = np.where(self.held, moved, 0.0) * self.share[:, None]
        return -0.5 * float(np.sum(moved * self.forces.sum(axis=0)))
