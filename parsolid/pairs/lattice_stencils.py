"""Pair weights of lattices in closed form, with the volumes and areas under which they sum by parts.

With g_ab = -g_ba, L_a = 1 and A_a the outward area vector of particle a (0 inside) every particle satisfies
    sum_b g_ab = -A_a / 2,      sum_b g_ab (x) (X_b - X_a) = V_a 1,
so that a constant stress has the force of its tractions, gradients of linear fields are exact, and the two passes stay
adjoint. Particles are the nodes of lattice cells; n nodes, d dimension, steps h_k along axis k.

Cells, on any union of them: each cell adds g_ab = e_k prod_{j != k} h_j / 2^d to each of its edges, prod h / 2^d to
the volume of each corner, and prod_{j != k} h_j / 2^(d-1) to the areas at the corners of each free face.

Boxes, product of one operator an axis: g_ab = e_k q(a_k, b_k) prod_{j != k} H_j h_j for nodes that differ along k
alone, V_a = prod H_j h_j, A_a = +-e_k prod_{j != k} H_j h_j. The operator is that of cells or the one of fourth order
inside and of second at ends: Strand, Summation by parts for finite difference approximations for d/dx, J. Comput.
Phys. 110 (1994).
"""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np

# widest offset along an axis of a pair with a weight
WIDEST = 3
# an axis with fewer nodes, mirrored ones counted, has no room for the ends of the operator of fourth order
FEWEST = 8
_NORM = np.array([17.0, 59.0, 43.0, 49.0]) / 48.0
_INSIDE = {1: 2.0 / 3.0, 2: -1.0 / 12.0}
# q_ij, i < j, at a lower end, as far as it is another than inside
_AT_END = {(0, 1): 59 / 96, (0, 2): -1 / 12, (0, 3): -1 / 32, (1, 2): 59 / 96, (1, 3): 0.0, (2, 3): 59 / 96}


class Axis(NamedTuple):
    """Nodes along an axis, their (mean) distance [m], and whether a mirror plane is at the lower and the upper end.

    places: of the nodes, in steps, where their distances differ; held: whether all nodes at an end stand still.
    """

    nodes: int
    step: float
    mirrored: tuple[bool, bool]
    places: tuple[float, ...] = ()
    held: tuple[bool, bool] = (False, False)

    @property
    def with_images(self) -> int:
        """Nodes with those beyond mirror planes."""
        return self.nodes + (self.nodes - 1) * sum(self.mirrored)

    @property
    def whole(self) -> "Axis":
        """With the nodes beyond mirror planes, of steps of 1 m."""
        places = np.array(self.places)
        if self.places and self.mirrored[0]:
            places = np.concatenate((2.0 * places[0] - places[:0:-1], places))
        if self.places and self.mirrored[1]:
            first = np.array(self.places)
            places = np.concatenate((places, 2.0 * first[-1] - first[-2::-1]))
        held = self.held if not any(self.mirrored) else (False, False)
        return Axis(self.with_images, 1.0, (False, False), tuple(places.tolist()), held)

    @property
    def wide(self) -> bool:
        """Whether the operator of fourth order fits."""
        return self.with_images >= FEWEST

    def undamped(self, wide: bool) -> np.ndarray:
        """Which nodes (count, 2) have no reconstructed dissipation with the one below and the one above them.

        On graded axes of fourth order the outermost pairs at ends without images: the gradients there change so fast
        that reconstructed jumps would feed waves.
        """
        result = np.zeros((self.nodes, 2), bool)
        if self.places and wide:
            ends = [at for at, mirrored in ((0, self.mirrored[0]), (self.nodes - 2, self.mirrored[1])) if not mirrored]
            result[ends, 1] = result[np.array(ends, int) + 1, 0] = True
        return result

    @property
    def highest_frequency(self) -> float:
        """Of waves of speed 1 m/s along the axis with free ends [1/s], times the step, of fourth order where `wide`.

        A mirrored axis has frequencies of one of twice its length; more than 16 nodes change nothing.
        """
        nodes = min(self.with_images, 16)
        free = Axis(nodes, 1.0, (False, False))
        norm, operator = np.sqrt(norms_of(free, self.wide)), operator_of(free, self.wide)
        slope = np.zeros((nodes, nodes + 2 * WIDEST))
        for i in range(nodes):
            slope[i, i : i + 2 * WIDEST + 1] = operator[i]
            slope[i, i + WIDEST] = -operator[i].sum()
        slope = slope[:, WIDEST:-WIDEST]
        return float(np.linalg.norm(slope / norm[:, None] / norm, 2))


class Stencils(NamedTuple):
    """weight (n, d, 7): g_ab = e_k weight[a, k, 3 + offset] for the neighbour at an offset along axis k, images too.
    undamped (n, d, 2): whether reconstructed jumps with the next node below and above do not dissipate, see
    `Axis.undamped`.

    volume (n,) [m^3], area (n, d) [m^2]: of the body's own part, without what is beyond mirror planes.
    """

    weight: np.ndarray
    undamped: np.ndarray
    volume: np.ndarray
    area: np.ndarray


def cell_stencils(
    index: list[np.ndarray], axes: list[Axis], holds: Callable[[list[np.ndarray]], np.ndarray]
) -> Stencils:
    """Of a union of cells; index: d arrays (n,) of nodes; holds: which cells, by d arrays of lower nodes, exist."""
    n, d = len(index[0]), len(axes)
    steps = np.array([axis.step for axis in axes])
    face = np.prod(steps) / steps
    exists = {side: holds([i + s for i, s in zip(index, side)]) for side in product((-1, 0), repeat=d)}
    mirrored = {side: _with_images(exists, side, index, axes) for side in exists}
    result = Stencils(np.zeros((n, d, 2 * WIDEST + 1)), np.zeros((n, d, 2), bool), np.zeros(n), np.zeros((n, d)))
    for side, here in exists.items():
        result.volume[:] += here * np.prod(steps) / 2**d
        for k, s in enumerate(side):
            sign = 2 * s + 1
            result.weight[:, k, WIDEST + sign] += mirrored[side] * (sign * face[k] / 2**d)
            result.area[:, k] -= here * (sign * face[k] / 2 ** (d - 1))
    return result


def _with_images(
    exists: dict[tuple[int, ...], np.ndarray], side: tuple[int, ...], index: list[np.ndarray], axes: list[Axis]
) -> np.ndarray:
    """Which cells on a side of the nodes exist, those beyond mirror planes as their images."""
    result = exists[side].copy()
    for other, found in exists.items():
        # images through the planes of the axes along which the sides differ
        beyond = np.ones(len(result), bool)
        for k, axis in enumerate(axes):
            if other[k] != side[k]:
                end = 0 if side[k] < 0 else axis.nodes - 1
                beyond &= axis.mirrored[0 if side[k] < 0 else 1] & (index[k] == end)
        result |= beyond & found
    return result


def box_stencils(index: list[np.ndarray], axes: list[Axis], fourth_order: bool = True) -> Stencils:
    """Of a box, of fourth order along every axis that is `wide`, or of cells; index: d arrays (n,)."""
    n, d = len(index[0]), len(axes)
    norms = [lengths_of(axis, fourth_order and axis.wide)[i] for axis, i in zip(axes, index)]
    own = [norm * _share(axis, i) for norm, axis, i in zip(norms, axes, index)]
    weight, undamped = np.zeros((n, d, 2 * WIDEST + 1)), np.zeros((n, d, 2), bool)
    result = Stencils(weight, undamped, np.prod(own, axis=0), np.zeros((n, d)))
    for k, axis in enumerate(axes):
        across = np.ones(n)
        result.area[:, k] = (index[k] == axis.nodes - 1).astype(float) - (index[k] == 0)
        for j in range(d):
            if j != k:
                across = across * norms[j]
                result.area[:, k] *= own[j]
        result.weight[:, k] = operator_of(axis, fourth_order and axis.wide)[index[k]] * across[:, None]
        result.undamped[:, k] = axis.undamped(fourth_order and axis.wide)[index[k]]
    return result


def _share(axis: Axis, index: np.ndarray) -> np.ndarray:
    """Half on mirror planes."""
    on = (axis.mirrored[0] & (index == 0)).astype(int) + (axis.mirrored[1] & (index == axis.nodes - 1))
    return np.asarray(0.5**on)


def norms_of(axis: Axis, wide: bool) -> np.ndarray:
    """H (count,) of an axis, of fourth order or of cells; whole on mirror planes."""
    end = _NORM if wide else np.array([0.5])
    norm = np.ones(axis.nodes)
    if not axis.mirrored[0]:
        norm[: len(end)] = end
    if not axis.mirrored[1]:
        norm[axis.nodes - len(end) :] = end[::-1]
    return norm


def lengths_of(axis: Axis, wide: bool) -> np.ndarray:
    """What each node has of an axis (count,) [m]: H h, or sum_j q_ij X_j where distances differ, so that gradients of
    linear fields are exact."""
    if not axis.places:
        return norms_of(axis, wide) * axis.step
    places, operator = np.array(axis.places), operator_of(axis, wide)
    # images, as far as there are nodes for them; operators reach no farther
    inner = places[1 : 1 + WIDEST], places[-2 : -2 - WIDEST : -1]
    room = [(WIDEST - len(one), 0) for one in inner]
    images = [np.pad(2.0 * end - one[::-1], width) for one, end, width in zip(inner, places[[0, -1]], room)]
    line = np.concatenate((images[0], places, images[1][::-1]))
    return np.array([operator[i] @ (line[i : i + 2 * WIDEST + 1] - places[i]) for i in range(axis.nodes)]) * axis.step


def operator_of(axis: Axis, wide: bool) -> np.ndarray:
    """q (count, 7) of an axis, by node and offset."""
    return np.array([[_entry(axis, wide, i, o) for o in range(-WIDEST, WIDEST + 1)] for i in range(axis.nodes)])


def _entry(axis: Axis, wide: bool, i: int, offset: int) -> float:
    """q of node i and the one at an offset, which may be an image."""
    low, high = min(i, i + offset), max(i, i + offset)
    last, sign = axis.nodes - 1, float(np.sign(offset))
    if (low < 0 and not axis.mirrored[0]) or (high > last and not axis.mirrored[1]) or offset == 0:
        return 0.0
    if not wide:
        return 0.5 * sign if abs(offset) == 1 else 0.0
    for pair, block in (((low, high), not axis.mirrored[0]), ((last - high, last - low), not axis.mirrored[1])):
        if block and pair in _AT_END:
            return sign * _AT_END[pair]
    return sign * _INSIDE.get(abs(offset), 0.0)
