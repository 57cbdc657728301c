"""What contact's impulses between steps need of a step of stages: the energy that stages take by themselves, and
impulses as the forces that they are half of.

For any rates k_i of stages and any quadratic form S, with the table's a_ij and b_i (Hairer, Lubich, Wanner, IV.2)

    S(y', y') - S(y, y) = 2 step sum b_i S(Y_i, k_i) - step^2 sum m_ij S(k_i, k_j)
    m_ij = b_i a_ij + b_j a_ji - b_i b_j

The ledger has the first sum: powers of stages with their weights. So kinetic energy lacks step^2/2 sum m_ij f_i . f_j/m
exactly, whatever forces do, and stored energy step^2/2 sum m_ij dF_i : C : dF_j, in which C : dF are differences of the
stages' P. With d = k_2 - k_1 and e = k_3 - (k_1 + k_2)/2 that is -step^2/2 (2/3 k_1 . e + d . d/12 + d . e/3 + 4/9 e .
e). Neither energies nor works are in it, so that the balance tells where forces and energies do not agree.
"""

from typing import Any

import numpy as np

from parsolid.particles.declaration import Columns, Field
from parsolid.solvers.runge_kutta import Stage


class StageLosses:
    """Kinetic and stored energy that the stages of one rank's particles take, found where bodies meet."""

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH`, to whose particles the stresses of stages are added."""
        self.system, d = system, system.dimension
        for k in range(3):
            system.particles.declare(Field(f"stress_of_stage_{k}", d * d, "Pa", layout=Columns(), carried=False))

    def stress_of(self, stage: Stage) -> np.ndarray:
        """Where P of a stage is kept."""
        number = 0 if stage.first else 2 if stage.last else 1
        return np.asarray(self.system.particles.storage(f"stress_of_stage_{number}"))

    def note_strain(self, stage: Stage) -> None:
        """Keep F before a stage."""
        F = self.system.particles.owned_rows("deformation_gradient")
        if stage.first:
            self._F_start = F.copy()
        elif stage.last:
            self._F_last = F.copy()
        else:
            self._F_second = F.copy()

    def note_motion(self, stage: Stage, step: float, T: np.ndarray, D: np.ndarray, external: Any) -> None:
        """Accelerations (d, owned) of a stage, and in the last one the kinetic energy [J] that stages take."""
        system, owned = self.system, self.system.owned
        mass, free = system.mass * system.share, system.conditions.free
        rate = (T[:, :owned] + D[:, :owned]) / system.mass
        if external is not None:
            rate += external / mass
        free = 1.0 if free is None else free[:, :owned]
        if stage.first:
            self._first_rate = free * rate
        if stage.last:
            stored = system.particles.storage
            gained = stored("velocity")[:, :owned] - stored("velocity_at_start")[:, :owned]
            mean = free * gained * (2.0 / step) if step > 0.0 else self._first_rate
            rest, change = free * rate - mean, mean - self._first_rate
            form = (mean * (2.0 / 3.0) + rest * (4.0 / 9.0)) * rest + change * change * (1.0 / 3.0)
            self._kinetic = -0.5 * step * step * float(np.sum(mass * form))

    def of_step(self, step: float) -> float:
        """Energy [J] that the stages of a step [s] have taken."""
        if step == 0.0:
            return 0.0
        system, d = self.system, self.system.dimension
        of = system.particles.owned_rows
        F = of("deformation_gradient")
        P1, P2, P3 = (of(f"stress_of_stage_{k}") for k in range(3))
        P4 = np.concatenate([np.zeros((0, 3, 3)), *(one.stresses(one.first, one.last) for one in system.blocks)])
        P4 = P4[:, :d, :d].reshape(-1, d * d)
        first = (self._F_second - self._F_start) / step
        mean = (2.0 / step) * (self._F_last - self._F_start)
        last = (1.5 * F - 0.5 * self._F_start - self._F_last) / step
        form = (2.0 / 3.0) * (last - mean) * (P4 - P1) + (1.0 / 3.0) * (mean - first) * (2.0 * P3 - P1 - P2)
        return self._kinetic - 0.5 * step * float(of("volume") @ form.sum(axis=1))


class CarriedImpulses:
    """Impulses F dt/2 that contact gives before a step of stages.

    Given at once, velocities within the step of what rests under F and the stresses would swing between F dt/2m and
    -F dt/2m, and damping would take from that. So F acts in all stages, and F dt/2 is taken back at the end, where
    contact gives half of the new force: the same step where nothing else acts, v' = v + dt (F + F')/2m, x' = x + dt v +
    dt^2 F/2m.
    """

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH`."""
        self.system = system
        self.waiting: list[tuple[np.ndarray, np.ndarray]] = []

    def take(self, impulse: np.ndarray, rows: np.ndarray) -> None:
        """Impulses (k, d) [N s] on the parts of rows (k,) on this side of mirror planes."""
        self.waiting.append((impulse.copy(), rows.copy()))

    def begin(self) -> None:
        """Of several steps of its own in a common one, the first has the impulses."""
        while self.waiting and self.system.substeps > 1:
            self.system.kick(*self.waiting.pop(0))

    def act(self, force: np.ndarray, step: float) -> None:
        """Add the forces to those (d, n) [N] on whole particles of a stage of a step [s].

        Held components have none: contact books itself what it takes to hold them.
        """
        held = self.system.held_components() if self.waiting else None
        for impulse, rows in self.waiting:
            acting = impulse if held is None else np.where(held[rows], 0.0, impulse)
            force[:, rows] += (acting * (2.0 / step / self.system.share[rows, None])).T

    def end(self) -> None:
        """Take back what the closing half has of the first force, after the last stage."""
        while self.waiting:
            impulse, rows = self.waiting.pop(0)
            self.system.kick(-impulse, rows)
