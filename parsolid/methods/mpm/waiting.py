"""Impulses that wait for the next step, what forces between steps and stresses do along the ways of matter, and the
energies of particles at one time where velocities lag."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.collective import SolverError
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.powers import power, power_at_end
from parsolid.numerics.lanes import aligned_zeros
from parsolid.particles.declaration import Field


class WaitingImpulses:
    """Fields of particles that something acts on between steps: "impulse" of the way before its places, "opening" of
    that after them, and "moved", the mean velocity of their places in the last common step [m/s]. step: the last one
    [s]; goes_on: whether the next one goes on from another run's velocities, whose last step is taken to be as long.

    Velocities are half a step behind places: forces of a time act for half of the steps before and after it
    (`kicked`), the same halves in which contact gives its impulses. Each half does its work along the way of matter in
    its step, of places for impulses, of strains for stresses; what particles gain of it less is lost in the transfers.
    """

    def __init__(self, points: MaterialPoints) -> None:
        self.points, self.step, self.goes_on = points, 0.0, False
        # work [J] of the first halves of stresses, which velocities do not have yet; of all forces in a step
        self.behind, self.work = 0.0, 0.0
        points.declare(Field("moved", points.dimension, "m/s", checkpointed=True))
        self.mean = "moved"
        if points.settings.substeps not in (None, 1):
            self.mean = "moved_in_common_step"
            points.declare(Field(self.mean, points.dimension, "m/s", checkpointed=True))
        # number of the step in the common one and how many there are
        self.place = 0, 1
        self._ways = aligned_zeros((0, 4))

    def kicked(self, step: float) -> float:
        """For how long [s] forces of the present places act in a step [s]: half of it and of the last one."""
        last = step if self.goes_on else self.step
        return 0.5 * (last + step) if step > 0.0 else 0.0

    def take(self, forces: np.ndarray | None, step: float, place: tuple[int, int]) -> np.ndarray | None:
        """Forces (capacity, 4) [N] of loads and of the impulses given since the last step [s], of several steps in a
        common one all in the first.

        place: number of the step among those of the common one, and how many those are.
        """
        self.work, self.place = 0.0, place
        if step == 0.0:
            return forces
        rows = self.points.owned_rows
        force, impulse, result = rows("external_force"), rows("external_impulse"), forces
        kicked = self.kicked(step)
        self.work = self.behind + float(np.sum((kicked - 0.5 * step) * force * rows("moved")))
        self.work += float(np.sum(impulse * rows(self.mean)))
        if force.any() or impulse.any():
            result = aligned_zeros((self.points.capacity, 4)) if forces is None else forces.copy()
            result[: self.points.owned, : self.points.dimension] += force + impulse / kicked
            impulse[:] = 0.0
        return result

    def ways(self) -> np.ndarray:
        """Where the step keeps the velocities by which places change (capacity, 4) [m/s]."""
        if len(self._ways) < self.points.capacity:
            self._ways = aligned_zeros((self.points.capacity, 4))
        return self._ways

    def note_work(self, step: float) -> None:
        """Add what forces do [J] in a step [s] that moves and strains particles, before stresses change."""
        storage, rows = self.points.storage, self.points.owned_rows
        moved, owned = rows("moved"), self.points.owned
        now = self._ways[:owned, : self.points.dimension]
        self.work += 0.5 * step * float(np.sum(rows("external_force") * now))
        moved[:] = now
        if self.mean != "moved":
            number, count = self.place
            rows(self.mean)[:] = now / count + (rows(self.mean) if number else 0.0)
        rate = storage("velocity_gradient")
        if "nominal_stress_and_volume" in self.points:
            # gradients by reference place
            strained = float(np.sum(storage("nominal_stress_and_volume")[:owned] * rate[:owned]))
        else:
            strained = power(owned, storage("stress_and_volume"), rate)
        self.work -= 0.5 * step * strained

    def follow(self, step: float) -> float:
        """The work of the first half of new stresses in a step [s]; what there is more of it [J] than was known."""
        before = self.behind
        if step > 0.0:
            storage = self.points.storage
            arrays = storage("stress_and_volume"), storage("velocity_gradient")
            self.step, self.goes_on = step, False
            self.behind = -0.5 * step * power_at_end(self.points.owned, *arrays, step)
        return self.behind - before

    def go_on(self, step: float) -> None:
        """From another run's state, whose steps were about so long [s]."""
        self.follow(step)
        self.goes_on = True

    def energy(self) -> float:
        """What particles will have gained by the time of their places [J]: velocities are half a step behind."""
        rows = self.points.owned_rows
        first_half = 0.5 * self.step * np.sum(rows("external_force") * rows("moved"))
        return float(first_half + np.sum(rows("external_impulse") * rows(self.mean))) + self.behind

    def state(self, comm: MPI.Comm) -> dict[str, Any]:
        """What a restart needs besides fields; collective."""
        return {"step": self.step, "behind": comm.allgather(self.behind)}

    def set_state(self, comm: MPI.Comm, state: dict[str, Any] | None) -> None:
        """Take back what `state` gave, on any number of ranks. Raises SolverError, on all, where there is nothing:
        velocities of earlier versions are of other times."""
        if not state:
            raise SolverError(
                "method: expected a checkpoint that this version of parsolid has written, found one without the step "
                "and the work that its velocities lack"
            )
        behind = state["behind"]
        self.step = state["step"]
        self.behind = behind[comm.rank] if len(behind) == comm.size else sum(behind) / comm.size
