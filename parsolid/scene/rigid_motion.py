"""Rigid motion in time: rotation about an axis that may move, as prescribed displacement and velocity."""

from collections.abc import Sequence

import numpy as np

from parsolid.scene.formulas import Formula, FormulaVector
from parsolid.scene.load_histories import NEAR


class RigidMotion:
    """x = c + d(t) + R(angle(t)) (X - c), as a course of displacement, or of velocity; see `LoadHistory`.

    jumps: times [s] at which a rate jumps.
    """

    def __init__(
        self,
        centre: Sequence[float],
        axis: Sequence[float] | None,
        angle: Formula,
        displacement: FormulaVector | None,
        quantity: str = "displacement",
        index: int | None = None,
    ):
        """index: of one component alone."""
        self.dimension = len(centre)
        self.stated = centre, axis, angle, displacement
        self.quantity, self.index = quantity, index
        self.centre = np.array(centre)
        direction = np.array([0.0, 0.0, 1.0] if axis is None else axis)
        x, y, z = direction / np.linalg.norm(direction)
        self.spin = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        moved = displacement if displacement is not None else [Formula(0.0)] * self.dimension
        self.formulas = FormulaVector((angle, *moved))
        self.rates = FormulaVector([one.rate() for one in self.formulas])
        self.jumps = tuple(sorted(self.formulas.corners))
        self.depends_on_time = True

    @property
    def free(self) -> np.ndarray:
        """No component is."""
        return np.zeros(self.dimension, bool)

    @property
    def jump_times(self) -> list[float]:
        """Times [s] at which the motion jumps."""
        return sorted(self.formulas.jumps)

    def component(self, index: int) -> "RigidMotion":
        """One component alone."""
        return RigidMotion(*self.stated, self.quantity, index)

    def velocity(self) -> "RigidMotion":
        """The velocity of the motion."""
        return RigidMotion(*self.stated, "velocity", self.index)

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """(n, components) at points (n, d) [m] and a time [s], of a corner just after, or just before it."""
        if time in self.jumps:
            time += (-1.0 if before else 1.0) * NEAR * max(1.0, time)
        origin = np.zeros((1, 3))
        angle, *moved = self.formulas.evaluate(origin, time)[0]
        rate, *speed = self.rates.evaluate(origin, time)[0]
        d, spin = self.dimension, self.spin
        turned = np.eye(3) + np.sin(angle) * spin + (1.0 - np.cos(angle)) * spin @ spin
        arm = points - self.centre
        if self.quantity == "velocity":
            result = arm @ (rate * spin @ turned)[:d, :d].T + np.array(speed)
        else:
            result = arm @ (turned - np.eye(3))[:d, :d].T + np.array(moved)
        return result if self.index is None else result[:, self.index, None]
