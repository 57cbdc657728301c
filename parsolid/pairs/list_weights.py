"""Weights (g_ab, k_ab) of pair lists, and the corrections L_a that make gradients of linear fields exact.

g_ab = V_a V_b grad_a W(X_a - X_b) of a smoothing kernel [m^5 in space, m^3 in the plane], or, between nodes of a
lattice of cells, in closed form (`cell_weights`), or changed until they close (`closure`). L_a = [sum_b g_ab (x)
(X_b - X_a) / V_a]^-1, eq (71) of Lee et al. k_ab scales the Riemann dissipation: S/2 |C_skew| with C_skew = (L_a + L_b)
g_ab and a factor S, eq (75), over |g_ab| where impedances depend on the direction of g_ab.
"""

from typing import Any

import numpy as np

from parsolid.collective import raise_together
from parsolid.kernels import kernel
from parsolid.pairs.cell_weights import NodesOfCells
from parsolid.pairs.closure import close
from parsolid.pairs.pair_list import Neighbours, distance_in_support, weights_of_pairs
from parsolid.pairs.smoothing.gradient import gradient_factor

# how far a neighbour may stand beside its lattice place, in steps
_ASTRAY = 1e-3


class ListWeights:
    """The choice of weights of pair lists.

    kernel: of `smoothing.smoothing_kernel`. dissipation: the factor S. directional: whether impedances depend on the
    direction of g_ab. surface: area vectors (owned, d) [m^2], shares (owned,) and which particles (owned,) are to have
    closed weights, see `closure.Closure`, or None. cells: of owned particles, or None; pairs of two lattices, or of
    one and a particle on none, have no weight. rounded: whether weights are float32, of which few differ on lattices.
    """

    def __init__(
        self,
        kernel: Any,
        dissipation: float = 1.0,
        directional: bool = False,
        surface: Any = None,
        cells: NodesOfCells | None = None,
        rounded: bool = False,
    ) -> None:
        self.kernel, self.support, self.dissipation = kernel, kernel.support, dissipation
        self.directional, self.surface, self.cells, self.rounded = directional, surface, cells, rounded

    def fill(self, near: Neighbours) -> np.ndarray:
        """Fill the weights of both lists; the corrections L (owned, d, d). Collective.

        Raises SolverError on all ranks for a particle without neighbours and for weights that cannot be closed.
        """
        if self.cells is not None:
            number = near.with_ghosts_and_images(self.cells.number, "number")
            near.inner, near.outer = (_on_lattices(one, self.cells, number, near.positions) for one in near.lists)
        for pairs in near.lists:
            kernel_weights(self.kernel, pairs, near.positions, near.metric, near.volume)
            if self.cells is not None:
                fill_cell_weights(self.cells, pairs, near.positions)
        if self.rounded:
            # before corrections are found: gradients of linear fields stay exact
            near.inner, near.outer = (one._replace(weight=one.weight.astype(np.float32)) for one in near.lists)
        correction = corrections(near)
        if self.surface is not None:
            correction = close(near, correction, self.surface, lambda: corrections(near))
        everywhere = near.with_ghosts_and_images(correction, "tensor")
        for pairs in near.lists:
            jump_factors(pairs, everywhere, self.dissipation, self.directional)
        if self.rounded:
            near.inner, near.outer = (one.by_kinds() for one in near.lists)
        return correction


@kernel
def kernel_weights(smoothing, pairs, positions, metric, volume):
    """Fill g_ab of a smoothing kernel W(q) = c sqrt(det M) f(q), q^2 = x . M x with the mean M of both metrics."""
    d, last = positions.shape[1], metric.shape[0] - 1
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            M, N = metric[min(a, last)], metric[min(b, last)]
            m0, m1, m2 = 0.5 * (M[0] + N[0]), 0.5 * (M[1] + N[1]), 0.5 * (M[2] + N[2])
            m3, m4, m5 = 0.5 * (M[3] + N[3]), 0.5 * (M[4] + N[4]), 0.5 * (M[5] + N[5])
            x, y = positions[a, 0] - positions[b, 0], positions[a, 1] - positions[b, 1]
            z = positions[a, 2] - positions[b, 2] if d == 3 else 0.0
            determinant = m0 * (m1 * m2 - m5 * m5) - m3 * (m3 * m2 - m4 * m5) + m4 * (m3 * m5 - m4 * m1)
            q = distance_in_support(positions, metric, a, b)
            factor = volume[a] * volume[b] * determinant**0.5 * gradient_factor(smoothing, q, d)
            pairs.weight[k, 0] = factor * (m0 * x + m3 * y + m4 * z)
            pairs.weight[k, 1] = factor * (m3 * x + m1 * y + m5 * z)
            if d == 3:
                pairs.weight[k, 2] = factor * (m4 * x + m5 * y + m2 * z)


@kernel
def add_moments(pairs, positions, moment):
    """Add sum_b g_ab (x) (X_b - X_a) to moment (rows, d, d) of both particles."""
    d = positions.shape[1]
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            for i in range(d):
                for j in range(d):
                    term = pairs.weight[k, i] * (positions[b, j] - positions[a, j])
                    moment[a, i, j] += term
                    moment[b, i, j] += term


def corrections(near: Neighbours) -> np.ndarray:
    """L (owned, d, d) of the present weights; collective. Raises SolverError on all ranks for a particle that no other
    reaches."""
    d, owned = near.positions.shape[1], near.owned
    moment = np.zeros((near.rows, d, d))
    for pairs in near.lists:
        add_moments(pairs, near.positions, moment)
    moment = moment[:owned]
    alone, fault = ~moment.any(axis=(1, 2)), None
    if alone.any():
        place = ", ".join(f"{x:.6g}" for x in near.positions[np.argmax(alone)])
        fault = f"method.smoothing: expected every particle to have a neighbour, found none for that at ({place})"
    raise_together(near.comm, fault)
    moment = moment / near.volume[:owned, None, None]
    # the pseudo-inverse where neighbours do not span space, as in a single layer
    size = np.abs(moment).max(axis=(1, 2), initial=0.0)
    good = np.abs(np.linalg.det(moment)) > 1e-8 * size**d
    result = np.empty_like(moment)
    result[good] = np.linalg.inv(moment[good])
    result[~good] = np.linalg.pinv(moment[~good], rcond=1e-6)
    return result


@kernel
def jump_factors(pairs, correction, factor, directional):
    """Fill k_ab, in the column behind g_ab; correction (rows, d, d)."""
    d = correction.shape[1]
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, skew, length = pairs.neighbour[k], 0.0, 0.0
            for i in range(d):
                component, g = 0.0, np.float64(pairs.weight[k, i])
                for j in range(d):
                    component += (correction[a, i, j] + correction[b, i, j]) * pairs.weight[k, j]
                skew += component * component
                length += g * g
            if not directional:
                pairs.weight[k, d] = 0.5 * factor * skew**0.5
            else:
                pairs.weight[k, d] = 0.5 * factor * (skew / length) ** 0.5 if length > 0.0 else 0.0


# --- nodes of cells ----------------------------------------------------------------------------------------------


@kernel
def cell_weight(cells, positions, a, b):
    """(axis, weight) of owned particle a and particle b on its lattice; weight 0.0 where they are no pair."""
    axis, steps = -1, 0
    for i in range(positions.shape[1]):
        distance = (positions[b, i] - positions[a, i]) / cells.spacing[a, i]
        offset = round(distance)
        if abs(distance - offset) > _ASTRAY or abs(offset) > 1 or (offset != 0 and axis >= 0):
            return 0, 0.0
        if offset != 0:
            axis, steps = i, offset
    return max(axis, 0), cells.weight[a, max(axis, 0), (steps + 1) // 2] if axis >= 0 else 0.0


@kernel
def _with_weights(pairs, cells, number, positions):
    kept, count = np.empty(pairs.neighbour.size, np.bool_), np.zeros(pairs.start.size, np.int64)
    for a in range(pairs.start.size - 1):
        count[a + 1] = count[a]
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            kept[k] = number[a] == number[b]
            if kept[k] and number[a] >= 0:
                kept[k] = cell_weight(cells, positions, a, b)[1] != 0.0
            count[a + 1] += kept[k]
    return count, pairs.neighbour[kept]


def _on_lattices(pairs: Any, cells: NodesOfCells, number: np.ndarray, positions: np.ndarray) -> Any:
    """The pairs whose particles are on one lattice and have a weight, or both on none; number (rows,)."""
    start, neighbour = _with_weights(pairs, cells, number, positions)
    return type(pairs)(start, neighbour, weights_of_pairs(len(neighbour)))


@kernel
def fill_cell_weights(cells, pairs, positions):
    """Put g_ab [m^2] of pairs on lattices over what is there."""
    for a in range(pairs.start.size - 1):
        if cells.number[a] < 0:
            continue
        for k in range(pairs.start[a], pairs.start[a + 1]):
            axis, weight = cell_weight(cells, positions, a, pairs.neighbour[k])
            for i in range(positions.shape[1]):
                pairs.weight[k, i] = weight if i == axis else 0.0
