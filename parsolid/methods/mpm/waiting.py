"""Impulses that wait for the next step, and the energies of particles at one time where velocities lag."""

import numpy as np

from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.numerics.lanes import aligned_zeros
from parsolid.particles.declaration import Field

# columns of the stress and of the velocity gradient that belong together
_PAIRS = ((0, 0), (1, 5), (2, 10), (4, 6), (4, 9), (5, 2), (5, 8), (6, 1), (6, 4))


class WaitingImpulses:
    """The field "impulse" of particles that something acts on between steps. step: the last one [s]."""

    def __init__(self, points: MaterialPoints) -> None:
        self.points, self.step = points, 0.0
        # of a checkpoint, until a step is taken
        self._kept: float | None = None
        points.declare(Field("impulse", points.dimension, "N s", checkpointed=True))
        if points.settings.substeps not in (None, 1):
            points.declare(Field("given_impulse", points.dimension, "N s"))

    def take(
        self, forces: np.ndarray | None, step: float, place: tuple[int, int]
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Forces (capacity, 4) [N] of loads and of the impulses given since the last step [s]; and what of them
        (owned, d) [N s] matter moves under in this step: of several steps in a common one all go to the first.

        place: number of the step among those of the common one, and how many those are.
        """
        if step == 0.0:
            return forces, None
        self.step, self._kept = step, None
        impulse = self.points.owned_rows("impulse")
        if place[1] > 1:
            given = self.points.owned_rows("given_impulse")
            if place[0] == 0:
                given[:] = impulse
            taken = given / place[1]
        else:
            taken = impulse.copy()
        if not impulse.any():
            return forces, taken if taken.any() else None
        result = aligned_zeros((self.points.capacity, 4)) if forces is None else forces.copy()
        result[: self.points.owned, : self.points.dimension] += impulse / step
        impulse[:] = 0.0
        return result, taken

    def energy(self) -> float:
        """What particles will have gained by the time of their places [J]: velocities are half a step behind.

        Of waiting impulses J . v, of stresses -dt/2 V sigma : l.
        """
        rows = self.points.owned_rows
        return float(np.sum(rows("impulse") * rows("velocity"))) + self.lag()

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
