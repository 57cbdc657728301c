"""Pair weights of nodes of any union of lattice cells, with the volumes and areas under which they sum by parts.

With g_ab = -g_ba, L_a = 1 and A_a the outward area vector of node a (0 inside) every node satisfies

    sum_b g_ab = -A_a / 2,      sum_b g_ab (x) (X_b - X_a) = V_a 1,

so that a constant stress has the force of its tractions, gradients of linear fields are exact, and the two sweeps stay
adjoint. Each cell with steps h_k adds g_ab = e_k prod_{j != k} h_j / 2^d to each of its edges along axis k,
prod h / 2^d to the volume of each corner, and prod_{j != k} h_j / 2^(d-1) to the areas at the corners of each free
face.
"""

from collections.abc import Callable, Iterable
from itertools import product
from typing import NamedTuple

import numpy as np

from parsolid.pairs.box_weights import Axis


class Cells(NamedTuple):
    """Weights of nodes (n,): weight (n, d, 2), with g_ab = e_k times it for the next node below and above along axis k,
    images included;
    volume (n,) [m^3] and area (n, d) [m^2] of the body's own part, without what is beyond mirror planes."""

    weight: np.ndarray
    volume: np.ndarray
    area: np.ndarray


class NodesOfCells(NamedTuple):
    """Lattices of particles with pair lists: number (n,) int64 of the lattice, -1 on none; spacing (n, d) [m]; weight
    (n, d, 2) of `Cells`."""

    number: np.ndarray
    spacing: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, spacing: np.ndarray, bodies: Iterable[tuple[int, np.ndarray, Cells]]) -> "NodesOfCells":
        """spacing (n, d) [m]; bodies: number, rows (k,) and cells of each."""
        result = cls(np.full(len(spacing), -1), spacing.copy(), np.zeros((*spacing.shape, 2)))
        for number, rows, cells in bodies:
            result.number[rows], result.weight[rows] = number, cells.weight
        return result


def cells_around(index: list[np.ndarray], axes: list[Axis], holds: Callable[[list[np.ndarray]], np.ndarray]) -> Cells:
    """index: d arrays (n,) of nodes; holds: which cells, by d arrays of lower nodes, exist."""
    n, d = len(index[0]), len(axes)
    steps = np.array([axis.step for axis in axes])
    face = np.prod(steps) / steps
    exists = {side: holds([i + s for i, s in zip(index, side)]) for side in product((-1, 0), repeat=d)}
    result = Cells(np.zeros((n, d, 2)), np.zeros(n), np.zeros((n, d)))
    for side, here in exists.items():
        result.volume[:] += here * np.prod(steps) / 2**d
        mirrored = _with_images(exists, side, index, axes)
        for k, s in enumerate(side):
            sign = 2 * s + 1
            result.weight[:, k, 1 + s] += mirrored * (sign * face[k] / 2**d)
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
                beyond &= bool(axis.mirrors[0 if side[k] < 0 else 1]) & (index[k] == end)
        result |= beyond & found
    return result
