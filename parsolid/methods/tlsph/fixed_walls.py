"""What a fixed plane gives to cell-centred particles, or takes from them, through images that are not adjoint.

The gradient sees v' = Q v at X' = R X + T, and the power of the stresses would be the rate of the stored energy if an
image had the stress Q P L R. It has s Q P L Q, so that a uniform stress at the wall is balanced: at a fixed plane the
columns of P L along the plane have the other sign. The forces that differ, sum_b (s Q P L Q - Q P L R)_b g_ab, do work
on the particles beside the plane; at rollers and antisymmetric planes they are zero.
"""

from typing import Any

import numpy as np

from decomposition.compiled import compiled
from parsolid.methods.tlsph.reactions import Reactions
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
    """The work [J] of one rank's images at fixed planes in a step, as `reactions.Reactions` ask for it."""

    work = 0.0

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH`, before its lists are made."""
        self.particles, self.pairs, d = system.particles, system.pairs, system.dimension
        codes = self.pairs.codes
        Q, R = codes.signs[:, :d], codes.reflections[:, :d]
        self.factors = codes.stress_signs[:, None, None] * Q[:, :, None] * Q[:, None] - Q[:, :, None] * R[:, None]
        first, width = record_columns(system.space, self.pairs.terms).stress, matrix_columns(d)
        self.columns, self.width = slice(first, first + width), width // d
        self.staged = system.leapfrog is None
        # a step without stages begins with the force that the one before ended with
        self.particles.declare(Field("excess_wall_force", d, "N", checkpointed=not self.staged, mirror="vector"))

    def meet(self, before: bool) -> None:
        """The forces of a stage; before: whether it ends a step, or is within it."""
        if self.staged or before:
            self.find()

    def find(self) -> None:
        """The forces of the present records, after ghosts have sent theirs."""
        force, pairs = self.particles.owned_rows("excess_wall_force"), self.pairs.mirror
        force[:] = 0.0
        stress = self.particles.storage("record")[:, self.columns].reshape(-1, force.shape[1], self.width)
        lists = (pairs.start, pairs.neighbour, pairs.images.code, pairs.weight)
        add_excess_forces(*lists, self.factors, stress, force)

    def book(self, duration: float) -> None:
        """Count their work over a duration [s] with the present velocities."""
        rows = self.particles.owned_rows
        power = np.add.reduce(rows("excess_wall_force") * rows("velocity"), axis=1) @ rows("share")
        self.work += duration * float(power)


def watch_fixed_walls(system: Any) -> None:
    """Let a system's reactions tell the work of its fixed planes, where there are any."""
    boundaries, codes = system.boundaries, system.pairs.codes
    if codes is not None and any(plane.kind == "fixed" for subset in codes.planes for plane in subset):
        if boundaries.reactions is None:
            boundaries.reactions = Reactions(system.particles, [])
        boundaries.reactions.walls = FixedWalls(system)
