"""What a fixed plane gives to cell-centred particles, or takes from them, through images that are not adjoint.

The gradient sees v' = Q v at X' = R X + T, and the power of the stresses would be the rate of the stored energy if an
image had the stress Q P L R. It has s Q P L Q, so that a uniform stress at the wall is balanced: at a fixed plane the
columns of P L along the plane have the other sign. The forces that differ, sum_b (s Q P L Q - Q P L R)_b g_ab, do work
on the particles beside the plane; at rollers and antisymmetric planes they are zero.
"""

from typing import Any

import numpy as np

from decomposition.compiled import compiled
from decomposition.recalled import Recalled
from parsolid.methods.tlsph.reactions import Reactions
from parsolid.pairs.terms import matrix_columns, record_columns
from parsolid.particles.declaration import Field


@compiled
def excess_forces(
    rows: np.ndarray,
    start: np.ndarray,
    neighbour: np.ndarray,
    code: np.ndarray,
    weight: np.ndarray,
    factors: np.ndarray,
    stress: np.ndarray,
    force: np.ndarray,
) -> None:
    """Fill force (n, d) [N] of particles with images at rows (k,) with what is beyond the adjoint.

    start, neighbour, code, weight: of a list of pairs with images; factors (codes, d, d): s Q_i Q_j - Q_i R_j; stress
    (particles, d, width): P L column by column.
    """
    d = force.shape[1]
    for a in rows:
        for i in range(d):
            component = 0.0
            for k in range(start[a], start[a + 1]):
                of_pair = 0.0
                for j in range(d):
                    of_pair += factors[code[k], i, j] * stress[neighbour[k], j, i] * weight[k, j]
                component += of_pair
            force[a, i] = component


@compiled
def power_of_excess(rows: np.ndarray, force: np.ndarray, kinematics: np.ndarray, share: np.ndarray) -> float:
    """Power [W] of forces (n, d) [N] on the tributary parts of particles at rows (k,)."""
    power = 0.0
    for a in rows:
        for i in range(force.shape[1]):
            power += share[a] * force[a, i] * kinematics[a, i]
    return power


class FixedWalls:
    """The work [J] of one rank's images at fixed planes in a step, as `reactions.Reactions` ask for it."""

    work = 0.0

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH`, before its lists are made."""
        self.particles, self.pairs, d = system.particles, system.pairs, system.dimension
        self.boundaries = system.boundaries
        codes = self.pairs.codes
        Q, R = codes.signs[:, :d], codes.reflections[:, :d]
        self.factors = codes.stress_signs[:, None, None] * Q[:, :, None] * Q[:, None] - Q[:, :, None] * R[:, None]
        first, width = record_columns(system.space, self.pairs.terms).stress, matrix_columns(d)
        self.columns, self.width = slice(first, first + width), width // d
        self.staged = system.leapfrog is None
        # the list of images for which the rows were looked up
        self._images: Any = None
        self._find, self._power = Recalled(excess_forces), Recalled(power_of_excess)
        # a step without stages begins with the force that the one before ended with
        self.particles.declare(Field("excess_wall_force", d, "N", checkpointed=not self.staged, mirror="vector"))

    def meet(self, before: bool) -> None:
        """The forces of a stage; before: whether it ends a step, or is within it."""
        if self.staged or before:
            self.find()

    @property
    def rows(self) -> np.ndarray:
        """Particles (k,) that have images and can move: on what is held no force does work."""
        images = self.pairs.mirror
        if images is not self._images:
            rows, clamp = np.flatnonzero(np.diff(images.start)), self.boundaries.clamp
            if clamp is not None:
                # a later condition moves what a plane holds
                driven = np.isin(rows, self.boundaries.prescribed.entries[0])
                rows = rows[driven | clamp[rows, : len(self.factors[0])].any(axis=1)]
            self._images, self._rows = images, rows
            others = np.delete(np.arange(len(images.start) - 1), self._rows)
            self.particles.owned_rows("excess_wall_force")[others] = 0.0
        return self._rows

    def find(self) -> None:
        """The forces of the present records, after ghosts have sent theirs."""
        if not len(self.rows):
            return
        force, pairs = self.particles.owned_rows("excess_wall_force"), self.pairs.mirror
        stress = self.particles.kept(("wall stress",), self._stress)
        self._find(
            self.rows, pairs.start, pairs.neighbour, pairs.images.code, pairs.weight, self.factors, stress, force
        )

    def _stress(self) -> np.ndarray:
        d = len(self.factors[0])
        return self.particles.storage("record")[:, self.columns].reshape(-1, d, self.width)

    def book(self, duration: float) -> None:
        """Count their work over a duration [s] with the present velocities."""
        if not len(self.rows):
            return
        of = self.particles.owned_rows
        power = self._power(self.rows, of("excess_wall_force"), self.particles.storage("kinematics"), of("share"))
        self.work += duration * float(power)


def watch_fixed_walls(system: Any) -> None:
    """Let a system's reactions tell the work of its fixed planes, where there are any."""
    boundaries, codes = system.boundaries, system.pairs.codes
    if codes is not None and any(plane.kind == "fixed" for subset in codes.planes for plane in subset):
        if boundaries.reactions is None:
            boundaries.reactions = Reactions(system.particles, [])
        boundaries.reactions.walls = FixedWalls(system)
