"""Impulses that wait for the next step, and the energies of particles at one time where velocities lag."""

import numpy as np

from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.numerics.lanes import aligned_zeros
from parsolid.particles.declaration import Field

# columns of the stress and of the velocity gradient that belong together
_PAIRS = ((0, 0), (1, 5), (2, 10), (4, 6), (4, 9), (5, 2), (5, 8), (6, 1), (6, 4))


class WaitingImpulses:
    """The field "impulse" of particles that something acts on between steps, and "moved", the mean velocity of their
    places in the last common step [m/s]. step: the last one [s].

    A force F between particles does the work F . dx/2 of their ways before and after it; the impulse J of both halves
    is given to the nodes and shows as J . (u + u')/2, u the velocities that particles bring to the nodes and u' those
    of the momentum that is mapped back. J . (moved before + moved after - u - u')/2 is lost in the transfers.
    """

    def __init__(self, points: MaterialPoints) -> None:
        self.points, self.step = points, 0.0
        # of a checkpoint, until a step is taken
        self._kept: float | None = None
        points.declare(Field("impulse", points.dimension, "N s", checkpointed=True))
        points.declare(Field("moved", points.dimension, "m/s", checkpointed=True))
        # of the common step: all of it, the part of each step, the number of this one and how many there are
        self.given: np.ndarray | None = None
        self.part: np.ndarray | None = None
        self.place = 0, 1
        self._ways = aligned_zeros((0, 4))
        # nothing has moved before the first common step, and only the half of its impulses that acts on the way after
        self.first = False
        if points.settings.substeps not in (None, 1):
            points.declare(Field("given_impulse", points.dimension, "N s"))

    def take(self, forces: np.ndarray | None, step: float, place: tuple[int, int]) -> np.ndarray | None:
        """Forces (capacity, 4) [N] of loads and of the impulses given since the last step [s], of several steps in a
        common one all in the first.

        place: number of the step among those of the common one, and how many those are.
        """
        if step == 0.0:
            return forces
        if place[0] == 0:
            self.first = self.step == 0.0 and self._kept is None
        self.step, self._kept, self.place = step, None, place
        impulse = self.points.owned_rows("impulse")
        self.given = impulse.copy() if place[0] == 0 and impulse.any() else None
        self.part = self.given
        if place[1] > 1:
            given = self.points.owned_rows("given_impulse")
            if place[0] == 0:
                given[:] = impulse
            self.part = given / place[1] if given.any() else None
        if self.given is None:
            return forces
        result = aligned_zeros((self.points.capacity, 4)) if forces is None else forces.copy()
        result[: self.points.owned, : self.points.dimension] += impulse / step
        impulse[:] = 0.0
        return result

    def ways(self) -> np.ndarray:
        """Where the step keeps the velocities by which places change (capacity, 4) [m/s]."""
        if len(self._ways) < self.points.capacity:
            self._ways = aligned_zeros((self.points.capacity, 4))
        return self._ways

    def lost(self, both: np.ndarray | None) -> float:
        """What transfers take [J] of the impulses of the step, and their "moved". both: u + u' (owned, d) [m/s], if
        impulses are given."""
        moved, (number, count), lost = self.points.owned_rows("moved"), self.place, 0.0
        now = self._ways[: self.points.owned, : self.points.dimension]
        if self.given is not None:
            lost += 0.5 * float(np.sum(self.given * (moved - both)))
        if self.part is not None:
            lost += (1.0 if self.first else 0.5) * float(np.sum(self.part * now))
        moved[:] = now / count + (moved if number else 0.0)
        return lost

    def energy(self) -> float:
        """What particles will have gained by the time of their places [J]: velocities are half a step behind.

        Of waiting impulses J . moved, of stresses -dt/2 V sigma : l.
        """
        rows = self.points.owned_rows
        return float(np.sum(rows("impulse") * rows("moved"))) + self.lag()

    def lag(self) -> float:
        """The part of the stresses [J]."""
        if self._kept is not None:
            return self._kept
        if self.step == 0.0:
            return 0.0
        owned = self.points.owned
        stress, rate = self.points.storage("stress_and_volume"), self.points.storage("velocity_gradient")
        power = sum(float(stress[:owned, i] @ rate[:owned, k]) for i, k in _PAIRS)
        return -0.5 * self.step * power

    def resume(self, lag: float) -> None:
        """Take back what `lag` gave before a checkpoint."""
        self._kept = lag
