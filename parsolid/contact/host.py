"""The particles of a system on which contact acts: their forces are part of those that their integrator takes."""

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.contact.body_pairs import share_of
from parsolid.contact.search import Search
from parsolid.kernels import kernel
from parsolid.methods.protocol import ParticleSystem


@kernel
def hand_over(candidate, recipient, part, source, target):
    """Sums (k, d) of recipients' candidates (m,), times the part (m,) that these are of whole particles' where not
    None, of an array (n, 3)."""
    target[:] = 0.0
    for m in range(len(candidate)):
        share = 1.0 if part is None else part[m]
        for i in range(target.shape[1]):
            target[recipient[m], i] += share * source[candidate[m], i]


class Host:
    """Rows (k,) of a system's particles that are candidates; forces (2, k, d) [N], on whole particles: in the present
    places, and what the impulse of the last step has besides where a gap has opened or closed in it, if `corrects`."""

    def __init__(self, system: ParticleSystem, number: int, search: Search) -> None:
        """number: of the system in the segments of candidates."""
        here = [one for one in search.segments if one.system == number]
        owned, empty = system.particles.owned_rows, np.zeros(0, np.int64)
        self.system, self.corrects = system, False
        self.rows, number_of = np.unique(np.concatenate([empty, *(one.rows for one in here)]), return_inverse=True)
        self.candidate = np.concatenate([empty, *(np.arange(one.first, one.last) for one in here)])
        self.recipient = np.ascontiguousarray(number_of.reshape(-1))
        self.forces = np.zeros((2, len(self.rows), system.dimension))
        self.forces[0] = owned("contact_force")[self.rows]
        self.share = share_of(system.particles, self.rows)
        part = search.points.share[self.candidate] / self.share[self.recipient]
        # of candidates, what they feel over what counts of their particles, where planes are not those of both bodies
        self.part = part if (part != 1.0).any() else None
        # rows of earlier lists may still show a force
        self._clean = False

    def resume(self, force: np.ndarray) -> None:
        """Take the forces (k, d) [N] of a checkpoint for those of the present places."""
        self.forces[0] = force
        self.system.particles.owned_rows("contact_force")[self.rows] = force

    def take(self, force: np.ndarray, correction: np.ndarray | None) -> None:
        """Forces (candidates, 3) [N] in new places, and what the impulse has besides, None without any."""
        owned = self.system.particles.owned_rows
        if not self._clean:
            owned("contact_force")[:], self._clean = 0.0, True
        self.corrects = correction is not None
        hand_over(self.candidate, self.recipient, self.part, force, self.forces[0])
        if correction is not None:
            hand_over(self.candidate, self.recipient, self.part, correction, self.forces[1])
        owned("contact_force")[self.rows] = self.forces[0]
        owned("contact_start")[self.rows] = owned("position")[self.rows]

    def give(self, step: float) -> None:
        """Add the forces to those on the particles, and the impulse that a step [s] has besides."""
        if not len(self.rows):
            return
        owned = self.system.particles.owned_rows
        owned(EXTERNAL_FORCE)[self.rows] += self.share[:, None] * self.forces[0]
        if self.corrects and step > 0.0:
            owned(EXTERNAL_IMPULSE)[self.rows] += 0.5 * step * self.share[:, None] * self.forces[1]

    def warm(self, heat: np.ndarray) -> float:
        """Give the particles what their candidates (m,) have of heat [J]; what of it the stored energy holds [J]."""
        mine = heat[self.candidate] if self.part is None else heat[self.candidate] * self.part
        taken = np.bincount(self.recipient, mine, minlength=len(self.rows))
        warmed = np.flatnonzero(taken)
        return self.system.take_heat(taken[warmed], self.rows[warmed])
