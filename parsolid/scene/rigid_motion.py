"""Rigid motion in time: rotation about an axis that may move, as prescribed displacement and velocity."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from parsolid.scene.formulas import Formula, FormulaVector
from parsolid.scene.load_histories import NEAR
from parsolid.scene.space_time import Mode, Separated, SeparatedFunction


class RigidMotion(SeparatedFunction):
    """The displacement, or the velocity, of x = c + d(t) + R(angle(t)) (X - c).

    jumps: times [s] at which a rate jumps.
    """

    def __init__(
        self,
        centre: Sequence[float],
        axis: Sequence[float] | None,
        angle: Formula,
        displacement: FormulaVector | None,
        quantity: str = "displacement",
    ):
        self.dimension = len(centre)
        self.stated = centre, axis, angle, displacement
        self.quantity = quantity
        self.centre = np.array(centre)
        direction = np.array([0.0, 0.0, 1.0] if axis is None else axis)
        x, y, z = direction / np.linalg.norm(direction)
        self.spin = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        moved = displacement if displacement is not None else [Formula(0.0)] * self.dimension
        self.formulas = FormulaVector((angle, *moved))
        self.rates = FormulaVector([one.rate() for one in self.formulas])
        self.jumps = tuple(sorted(self.formulas.corners))

    @property
    def free(self) -> np.ndarray:
        """No component is."""
        return np.zeros(self.dimension, bool)

    @property
    def jump_times(self) -> list[float]:
        """Times [s] at which the motion jumps."""
        return sorted(self.formulas.jumps)

    @property
    def two_sided_times(self) -> frozenset[float]:
        return frozenset(self.jumps)

    def velocity(self) -> "RigidMotion":
        """The velocity of the motion."""
        return RigidMotion(*self.stated, "velocity")

    def separated(self, points: np.ndarray) -> Separated:
        d, origin, is_velocity = self.dimension, np.zeros((1, 3)), self.quantity == "velocity"
        arm = (points - self.centre).T
        # R - 1 = sin S + (1 - cos) S^2 with the spin S, and S^3 = -S; sums that are the same whatever the other points
        turns = [sum(matrix[:d, j, None] * arm[j] for j in range(d)) for matrix in (self.spin, self.spin @ self.spin)]
        modes = [Mode(c, i, turned[c]) for i, turned in enumerate(turns) for c in range(d)]
        angle, *moved = [_alone(one, origin) for one in self.formulas]
        rate, *speeds = [_alone(one, origin) for one in self.rates]
        added = []
        if not all(one.is_constant for one in self.formulas[1:]):
            added, modes = speeds if is_velocity else moved, [*modes, *(Mode(c, 2 + c, 1.0) for c in range(d))]

        def factors(time: float, before: bool) -> list[float]:
            if time in self.jumps:
                time += (-1.0 if before else 1.0) * NEAR * max(1.0, time)
            turn = angle(time)
            sin, cos = (math.sin(turn), math.cos(turn)) if math.isfinite(turn) else (math.nan, math.nan)
            speed = rate(time) if is_velocity else 1.0
            turning = [speed * cos, speed * sin] if is_velocity else [sin, 1.0 - cos]
            return turning + [one(time) for one in added]

        return Separated(d, factors, [False] * (2 + len(added)), modes)


def _alone(formula: Formula, origin: np.ndarray) -> Callable[[float], float]:
    """A formula in t alone as a function of time [s]."""
    products = formula.products(origin)
    return lambda time: sum(float(mode) * (1.0 if factor is None else factor(time)) for factor, mode, _ in products)
