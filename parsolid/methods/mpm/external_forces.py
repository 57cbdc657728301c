"""Forces of contact, ties and tools on material points, and the energy balance with them.

These forces are found at the places of the end of a step and act in the next one. Velocities are half a step behind
places: forces of a time act for half of the steps before and after it (`ExternalForces.duration`). Each half does its
work along the way of matter in its step, of places for external forces, of strains for stresses; what particles gain
less is lost in the transfers.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.kernels import kernel
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.particles.declaration import Field
from parsolid.per_rank import PerRank, own_share


@kernel
def power(owned, stress, rate):
    """sum_p V sigma : l [W] of particles 0..owned-1; stress and rate as in `transfer`."""
    total = 0.0
    for p in range(owned):
        total += stress[p, 0] * rate[p, 0] + stress[p, 1] * rate[p, 5] + stress[p, 2] * rate[p, 10]
        total += stress[p, 4] * (rate[p, 6] + rate[p, 9]) + stress[p, 5] * (rate[p, 2] + rate[p, 8])
        total += stress[p, 6] * (rate[p, 1] + rate[p, 4])
    return total


@kernel
def power_at_end(owned, stress, rate, step):
    """As `power`, with gradients by the places at the end of a step [s], l (1 + dt l)^-1."""
    total = 0.0
    for p in range(owned):
        a, b, c = 1.0 + step * rate[p, 0], step * rate[p, 1], step * rate[p, 2]
        d, e, f = step * rate[p, 4], 1.0 + step * rate[p, 5], step * rate[p, 6]
        g, h, i = step * rate[p, 8], step * rate[p, 9], 1.0 + step * rate[p, 10]
        # dt l (1 + dt l)^-1 = 1 - (1 + dt l)^-1
        det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
        whole = stress[p, 0] + stress[p, 1] + stress[p, 2]
        part = stress[p, 0] * (e * i - f * h) + stress[p, 1] * (a * i - c * g) + stress[p, 2] * (a * e - b * d)
        part += stress[p, 4] * (c * d - a * f + b * g - a * h)
        part += stress[p, 5] * (b * f - c * e + d * h - e * g)
        part += stress[p, 6] * (c * h - b * i + f * g - d * i)
        total += whole - part / det
    return total / step


class LaggingWork:
    """Work [J] of stresses that velocities do not have yet: they are behind places.

    step: the last one [s]; lag [s]: by which velocities are behind, half of it where external forces make every kick
    one of two halves. Kicks as long as their steps keep the lag of the first one.
    """

    def __init__(self, points: MaterialPoints) -> None:
        self.points, self.step, self.lag, self.work = points, 0.0, 0.0, 0.0

    def follow(self, step: float, in_halves: bool) -> float:
        """Find the work for new stresses after a step [s]; its change [J]."""
        before = self.work
        if step > 0.0:
            storage = self.points.storage
            arrays = storage("stress_and_volume"), storage("velocity_gradient")
            self.step, self.lag = step, 0.5 * step if in_halves or self.lag == 0.0 else self.lag
            self.work = -self.lag * power_at_end(self.points.owned, *arrays, step)
        return self.work - before

    def state(self) -> dict[str, Any]:
        return {"step": self.step, "lag": self.lag, "work": PerRank(self.work)}

    def set_state(self, comm: MPI.Comm, state: dict[str, Any]) -> None:
        self.step, self.lag, self.work = state["step"], state["lag"], float(own_share(comm, state["work"])[0])


class ExternalForces:
    """External forces on the particles, and the energies of particles under them.

    Fields besides those of `ParticleSystem.take_external_forces`: "moved", the mean velocity of places in the last step
    [m/s], and, where several steps make a common one, the same of that. goes_on: whether the next one goes on from
    another run's velocities, whose last step is taken to be as long; work [J]: of all forces in the present step;
    behind: the system's.
    """

    def __init__(self, points: MaterialPoints, behind: LaggingWork) -> None:
        self.points, self.behind, self.goes_on, self.work = points, behind, False, 0.0
        points.declare(Field("moved", points.dimension, "m/s", checkpointed=True))
        self._mean = "moved"
        if points.settings.substeps not in (None, 1):
            self._mean = "moved_in_common_step"
            points.declare(Field(self._mean, points.dimension, "m/s", checkpointed=True))
        # number of the step in the common one and how many there are
        self._place = 0, 1
        self._paths = np.zeros((0, 4))

    def duration(self, step: float) -> float:
        """For how long [s] forces of the present places act in a step [s]: half of it and of the last one."""
        last = step if self.goes_on else self.behind.step
        return 0.5 * (last + step) if step > 0.0 else 0.0

    def add_to(self, forces: np.ndarray | None, step: float, place: tuple[int, int]) -> np.ndarray | None:
        """Forces (capacity, 4) [N] of loads with the external ones of a step [s]; impulses are used up.

        place: number of the step among those of the common one, and how many those are.
        """
        self.work, self._place = 0.0, place
        if step == 0.0:
            return forces
        rows, duration, result = self.points.owned_rows, self.duration(step), forces
        force, impulse = rows(EXTERNAL_FORCE), rows(EXTERNAL_IMPULSE)
        self.work = self.behind.work + float(np.sum((duration - 0.5 * step) * force * rows("moved")))
        self.work += float(np.sum(impulse * rows(self._mean)))
        if force.any() or impulse.any():
            result = np.zeros((self.points.capacity, 4)) if forces is None else forces.copy()
            result[: self.points.owned, : self.points.dimension] += force + impulse / duration
            impulse[:] = 0.0
        return result

    def paths(self) -> np.ndarray:
        """Array (capacity, 4) for the velocities by which places change in a step [m/s]."""
        if len(self._paths) < self.points.capacity:
            self._paths = np.zeros((self.points.capacity, 4))
        return self._paths

    def note_work(self, step: float) -> None:
        """Add what forces do [J] in a step [s] that has moved and strained particles, before stresses change."""
        storage, rows, owned = self.points.storage, self.points.owned_rows, self.points.owned
        now = self._paths[:owned, : self.points.dimension]
        self.work += 0.5 * step * float(np.sum(rows(EXTERNAL_FORCE) * now))
        rows("moved")[:] = now
        if self._mean != "moved":
            number, count = self._place
            rows(self._mean)[:] = now / count + (rows(self._mean) if number else 0.0)
        self.work -= 0.5 * step * power(owned, storage("stress_and_volume"), storage("velocity_gradient"))

    def energy(self) -> float:
        """Energy that particles gain up to the time of their places [J]: velocities are half a step behind."""
        rows = self.points.owned_rows
        first_half = 0.5 * self.behind.step * np.sum(rows(EXTERNAL_FORCE) * rows("moved"))
        return float(first_half + np.sum(rows(EXTERNAL_IMPULSE) * rows(self._mean))) + self.behind.work
