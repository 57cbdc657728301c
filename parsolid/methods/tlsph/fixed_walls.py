"""What a fixed plane gives to cell-centred particles, or takes from them, through images that are not adjoint.

The gradient sees v' = Q v at X' = R X + T, and the power of the stresses would be the rate of the stored energy if an
image had the stress Q P L R. It has s Q P L Q, so that a uniform stress at the wall is balanced: at a fixed plane the
columns of P L along the plane have the other sign. The forces that differ, sum_b (s Q P L Q - Q P L R)_b g_ab, do work
on the particles beside the plane; at rollers and antisymmetric planes they are zero.
"""

from typing import Any

import numpy as np

from parsolid.kernels import kernel
from parsolid.methods.tlsph.settings import FIXED_WALLS
from parsolid.pairs.pair_list import weight_row
from parsolid.particles.declaration import Field


@kernel
def excess_forces(rows, pairs, local, images, record, at_stress, force):
    """Fill force (n, d) [N] of the particles at rows (k,) with what is beyond the adjoint; record of particles."""
    d = force.shape[1]
    stride = 4 if d == 3 else 2
    for a in rows:
        for i in range(d):
            force[a, i] = 0.0
        for k in range(pairs.start[a], pairs.start[a + 1]):
            m, w = pairs.neighbour[k] - local, weight_row(pairs.kind, k)
            if m < 0:
                continue
            Q, R, s, b = images.signs[m], images.reflection[m], images.stress_sign[m], images.source[m]
            for i in range(d):
                for j in range(d):
                    factor = s * Q[i] * Q[j] - Q[i] * R[j]
                    force[a, i] += factor * record[b, at_stress + stride * j + i] * pairs.weight[w, j]


@kernel
def power(rows, force, velocity, share):
    """Power [W] of forces (n, d) [N] on the particles at rows (k,), of each the part share (n,)."""
    total = 0.0
    for a in rows:
        for c in range(force.shape[1]):
            total += share[a] * force[a, c] * velocity[a, c]
    return total


class FixedWalls:
    """The work [J] of one rank's images at fixed planes, for the ledger."""

    def __init__(self, system: Any, lists: Any) -> None:
        """lists: `list_bodies.ListBodies` of the system, with its pairs."""
        self.system, self.lists, self.particles, self.work = system, lists, system.particles, 0.0
        # a step without stages begins with the force that the one before ended with
        kept = system.leapfrog is not None
        self.particles.declare(Field("excess_wall_force", system.dimension, "N", checkpointed=kept, mirror="vector"))
        self._near: Any = None

    @property
    def rows(self) -> np.ndarray:
        """Rows (k,) of particles with images that can move: a later condition may move what a plane holds."""
        near = self.lists.near
        if self._near is not near:
            self._near, pairs, conditions = near, near.outer, self.system.conditions
            row = np.repeat(np.arange(near.owned), np.diff(pairs.start))
            rows = np.unique(row[pairs.neighbour >= near.local])
            moving = ~conditions.held[rows].all(axis=1)
            self._rows = rows[moving | np.isin(rows, conditions.motion.rows)]
            others = np.delete(np.arange(near.owned), self._rows)
            self.particles.owned_rows("excess_wall_force")[others] = 0.0
        return self._rows

    def find(self) -> None:
        """The forces of the present records."""
        near, at = self.lists.near, self.lists.columns
        force = self.particles.owned_rows("excess_wall_force")
        excess_forces(self.rows, near.outer, near.local, near.images, self.lists.record, at.stress, force)

    def observe(self, duration: float) -> None:
        """Count their work over a duration [s] with the present velocities, on this side of mirror planes."""
        of = self.particles.owned_rows
        self.work += duration * power(self.rows, of("excess_wall_force"), of("velocity"), of("share"))

    def book(self, ledger: Any) -> None:
        """Enter the work of a step into the ledger."""
        ledger.add_term(FIXED_WALLS, self.work)
        self.work = 0.0


def fixed_walls_of(system: Any, lists: Any) -> FixedWalls | None:
    """Those of a system, None without images at fixed planes."""
    codes = system.conditions.codes
    there = codes is not None and any(plane.kind == "fixed" for subset in codes.planes for plane in subset)
    return FixedWalls(system, lists) if there else None
