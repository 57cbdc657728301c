"""The particles of a system on which contact acts: they get its impulses, and those who guide them do its work."""

import numpy as np

from parsolid.contact.list_kernels import give_to_rows, hand_over, impulses, take_from_rows
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
        self.opened = None if system.verlet is None else np.zeros((len(self.rows), d))
        self.started, self.place = np.zeros((len(self.rows), 2 * d)), np.zeros((len(self.rows), d))
        self.share = np.ascontiguousarray(system.share[: system.owned][self.rows])
        part = entries.share[self.entry] / self.share[self.recipient]
        # of entries, what they feel over what counts of their particles, where planes are not those of both bodies
        self.part = part[:, None] if (part != 1.0).any() else None
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
        if opening and self.opened is not None:
            take_from_rows(owned("velocity"), self.rows, 0, self.opened)
            give_to_rows(self.opened, self.rows, owned("contact_start")[:, self.forces.shape[2] :])
        if step == 0.0:
            return
        force = self.forces[1] if opening or not self.crossing else self.forces[1] + self.forces[2]
        rows, impulse = impulses(self.rows, force, self.share, 0.5 * step)
        if len(rows):
            (system.kick_before if opening else system.kick)(impulse, rows)
        # of several steps of its own in one of all, the middle velocity is none that it had
        if ledger is not None and self.opened is not None and system.substeps == 1:
            book_swings(ledger, system, self.rows, step, self.forces, self.held, self.started)

    def warm(self, heat: np.ndarray) -> float:
        """Give the particles what their entries (entries,) have of heat [J]; what of it the stored energy holds [J]."""
        mine = heat[self.entry] if self.part is None else heat[self.entry] * self.part[:, 0]
        taken = np.bincount(self.recipient, mine, minlength=len(self.rows))
        warmed = np.flatnonzero(taken)
        return self.system.take_heat(taken[warmed], self.rows[warmed])

    def take(self, force: np.ndarray, extra: np.ndarray | None) -> float:
        """Forces (entries, d) [N] in new places; the work [J] of those who guide particles since the last places."""
        owned, forces = self.system.particles.owned_rows, self.forces
        shown, start, position = owned("contact_force"), owned("contact_start"), owned("position")
        if not self._clean:
            shown[:], self._clean = 0.0, True
        forces[0] = forces[1]
        self._hand_over(force, forces[1])
        self.crossing = extra is not None
        if extra is None:
            forces[2] = 0.0
        else:
            self._hand_over(extra, forces[2])
        give_to_rows(forces[1], self.rows, shown)
        work, d = 0.0, position.shape[1]
        if self.held is not None:
            moved = np.where(self.held, position[self.rows] - start[self.rows, :d], 0.0) * self.share[:, None]
            work = -0.5 * float(np.sum(moved * forces.sum(axis=0)))
        take_from_rows(start, self.rows, 0, self.started)
        take_from_rows(position, self.rows, 0, self.place)
        give_to_rows(self.place, self.rows, start)
        return work

    def _hand_over(self, force: np.ndarray, result: np.ndarray) -> None:
        """Sums (k, d) [N] of what entries (entries, d) have, on whole particles."""
        if self.part is not None:
            force = force.copy()
            force[self.entry] *= self.part
        hand_over(self.entry, self.recipient, force, result)
