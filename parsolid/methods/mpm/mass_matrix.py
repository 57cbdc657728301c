"""The consistent mass matrix of a step, by a few terms of the series of its inverse.

    M_ij = sum_p w_ip m_p w_jp,  m_i = sum_j M_ij,  P = m^-1 M        M^-1 m = sum_(j >= 0) (1 - P)^j

The first k terms (FMPM(k), Nairn and Hammerquist, Comput. Methods Appl. Mech. Engrg. 377 (2021) 113667) need no sum
over ranks but those of nodes, and lift no frequency by more than sqrt(k): P has its eigenvalues between 0 and 1. With
one term masses are lumped. With all FLIP keeps angular momentum,
sum_p m_p x_p x (sum_i w_ip a_i) = sum_i x_i x (M a)_i.
"""

from typing import Any

import numpy as np

from parsolid.methods.mpm.gather import gather
from parsolid.methods.mpm.grid import Flip
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.scatter import scatter
from parsolid.numerics.lanes import aligned_zeros


class MassMatrix:
    """Applies the series to what nodes have got with lumped masses."""

    def __init__(self, points: MaterialPoints):
        """points: `MaterialPoints`, of which `method.mass_terms` is the number of terms, at least 2."""
        self.points, self.terms = points, int(points.settings.mass_terms)
        self._particles, self._series = aligned_zeros((0, 8)), aligned_zeros((0, 8))

    def solve(self, nodes: Any, array: np.ndarray, column: int) -> None:
        """From vectors in three columns of an array (slots, 8) of `Nodes` that were divided by lumped masses, M^-1 m
        times them; what stands in `nodes.again` is lost, unless it is the array. Collective."""
        count, points = nodes.count, self.points
        if len(self._particles) < points.capacity:
            self._particles = aligned_zeros((points.capacity, 8))
        if len(self._series) < len(array):
            self._series = aligned_zeros(array.shape)
        particles, series = self._particles, self._series
        particles[: points.owned] = points.motion[: points.owned]
        series[:count, 3], series[:count, :3] = array[:count, 3], array[:count, column : column + 3]
        first = series[:count, :3].copy()
        for _ in range(self.terms - 1):
            nodes.spread(series)
            gather(nodes.interpolation, series, particles, 0.0, Flip(0.0), None, None, None)
            nodes.clear(nodes.again)
            scatter(nodes.interpolation, particles, Flip(0.0), None, None, nodes.again, nodes.partial)
            nodes.sum("again")
            nodes.divide_by_mass(nodes.again)
            series[:count, :3] += first - nodes.again[:count, :3]
        array[:count, column : column + 3] = series[:count, :3]

    def arrays(self) -> list[np.ndarray]:
        """Arrays that count as memory."""
        return [self._particles, self._series]
