"""The particles of a system on which contact acts: they get its impulses, and those who guide them do its work."""

import numpy as np

from parsolid.contact.list_kernels import give_to_rows, hand_over, impulses, keep_velocities, oscillation, start_anew
from parsolid.contact.lists import Segment
from parsolid.methods.protocol import ParticleSystem


class Recipient:
    """Rows (k,) of a system's particles that have entries; forces (3, k, d) [N]: at the start and at the end of the
    step under way, and what the impulse at its end has besides, where `crossing`."""

    def __init__(self, system: ParticleSystem, number: int, segments: list[Segment]) -> None:
        """number: of the system in the segments."""
        here = [one for one in segments if one.system == number]
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
        held = system.held_components()
        self.held = None if held is None or not held[self.rows].any() else held[self.rows]
        # rows of earlier lists may still show a force
        self._clean = False

    def resume(self, force: np.ndarray) -> None:
        """Take the forces (k, d) [N] of a checkpoint for those of the present places."""
        self.forces[1] = force
        give_to_rows(force, self.rows, self.system.particles.owned_rows("contact_force"))

    def kick(self, step: float, opening: bool) -> float:
        """Half a step [s] of the forces; at its end what leapfrog's oscillation has gained in it [J]."""
        if not len(self.rows):
            return 0.0
        system = self.system
        owned = system.particles.owned_rows
        if opening and system.verlet is not None:
            keep_velocities(self.rows, owned("velocity"), owned("contact_start"))
        if step == 0.0:
            return 0.0
        more = None if opening or not self.crossing else self.forces[2]
        rows, impulse = impulses(self.rows, self.forces[1], more, self.share, 0.5 * step)
        if len(rows):
            (system.kick_before if opening else system.kick)(impulse, rows)
        if opening or system.verlet is None or system.substeps > 1:
            # of several steps of its own in one of all, the middle velocity is none that it had
            return 0.0
        arrays = system.mass, system.share, self.held, self.started, owned("velocity"), owned("position")
        return float(oscillation(self.rows, step, system.verlet == "all", self.forces, *arrays))

    def warm(self, heat: np.ndarray) -> float:
        """Give the particles what their entries (entries,) have of heat [J]; what of it the stored energy holds [J]."""
        taken = np.bincount(self.recipient, heat[self.entry], minlength=len(self.rows))
        warmed = np.flatnonzero(taken)
        return self.system.take_heat(taken[warmed], self.rows[warmed])

    def take(self, force: np.ndarray, extra: np.ndarray | None) -> float:
        """Forces (entries, d) [N] in new places; the work [J] of those who guide particles since the last places."""
        owned = self.system.particles.owned_rows
        shown, start, position = owned("contact_force"), owned("contact_start"), owned("position")
        if not self._clean:
            shown[:], self._clean = 0.0, True
        self.crossing = extra is not None
        hand_over(self.entry, self.recipient, force, extra, self.forces)
        start_anew(self.rows, self.forces[1], position, shown, start, self.started)
        if self.held is None:
            return 0.0
        moved = position[self.rows] - self.started[:, : position.shape[1]]
        moved = np.where(self.held, moved, 0.0) * self.share[:, None]
        return -0.5 * float(np.sum(moved * self.forces.sum(axis=0)))
