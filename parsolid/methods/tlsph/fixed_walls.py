"""What a fixed plane gives to cell-centred particles, or takes from them, through images that are not adjoint.

The gradient sees v' = Q v at X' = R X + T, and the power of the stresses would be the rate of the stored energy if an
image had the stress Q P L R. It has s Q P L Q, so that a uniform stress at the wall is balanced: at a fixed plane the
columns of P L along the plane have the other sign. The forces that differ, sum_b (s Q P L Q - Q P L R)_b g_ab, do work
on the particles beside the plane; at rollers and antisymmetric planes they are zero.
"""

from typing import Any

import numpy as np

from decomposition.compiled import compiled
from parsolid.methods.tlsph.settings import FIXED_WALLS
from parsolid.pairs.terms import matrix_columns, record_columns
from parsolid.particles.declaration import Field


@compiled
def add_excess_forces(
    start: np.ndarray,
    neighbour: np.ndarray,
    code: np.ndarray,
    weight: np.ndarray,
    factors: np.ndarray,
    stress: np.ndarray,
    force: np.ndarray,
) -> None:
    """Add to force (n, d) [N] those of images beyond what is adjoint.

    start, neighbour, code, weight: of a list of pairs with images; factors (codes, d, d): s Q_i Q_j - Q_i R_j; stress
    (particles, d, width): P L column by column.
    """
    d = force.shape[1]
    for a in range(start.shape[0] - 1):
        for k in range(start[a], start[a + 1]):
            for i in range(d):
                for j in range(d):
                    force[a, i] += factors[code[k], i, j] * stress[neighbour[k], j, i] * weight[k, j]


class FixedWalls:
    """Books the work of one rank's images at fixed planes; of a scene without any it does nothing."""

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH`, before its lists are made."""
        self.particles, self.pairs = system.particles, system.pairs
        codes, d = self.pairs.codes, system.dimension
        planes = () if codes is None else {plane for subset in codes.planes for plane in subset}
        self.are_there = any(plane.kind == "fixed" for plane in planes)
        if not self.are_there:
            return
        Q, R = codes.signs[:, :d], codes.reflections[:, :d]
        self.factors = codes.stress_signs[:, None, None] * Q[:, :, None] * Q[:, None] - Q[:, :, None] * R[:, None]
        first, width = record_columns(system.space, self.pairs.terms).stress, matrix_columns(d)
        self.columns, self.width = slice(first, first + width), width // d
        # the force that a step begins with is that which the one before ended with
        self.particles.declare(Field("excess_wall_force", d, "N", checkpointed=True, mirror="vector"))

    def find(self) -> None:
        """The forces of the present records, after ghosts have sent theirs."""
        if self.are_there:
            force, pairs = self.particles.owned_rows("excess_wall_force"), self.pairs.mirror
            force[:] = 0.0
            stress = self.particles.storage("record")[:, self.columns].reshape(-1, force.shape[1], self.width)
            lists = (pairs.start, pairs.neighbour, pairs.images.code, pairs.weight)
            add_excess_forces(*lists, self.factors, stress, force)

    def meet(self, duration: float, ledger: Any) -> None:
        """Both."""
        self.find()
        self.book(duration, ledger)

    def book(self, duration: float, ledger: Any) -> None:
        """Tell the ledger of their work over a duration [s] with the present velocities."""
        if self.are_there:
            rows = self.particles.owned_rows
            power = np.sum(rows("excess_wall_force") * rows("velocity"), axis=1) @ rows("share")
            ledger.add_term(FIXED_WALLS, duration * float(power))
