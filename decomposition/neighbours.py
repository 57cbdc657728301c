"""Neighbour search by cell lists, and the order along cells that keeps neighbours close in memory."""

from typing import Any

import numpy as np
from numba import njit

from .cells import (
    Cells,
    build_cells,
    cell_coordinate,
    checked_bounds,
    checked_length,
    checked_points,
    grid,
    locate,
    stable_order,
    surround,
)


@njit(cache=True)
def _spread(value: int, dimension: int) -> np.int64:
    """The bits of a cell number, `dimension` places apart."""
    result = np.int64(0)
    bit = 0
    while value >> bit > 0:
        result |= ((value >> bit) & 1) << (bit * dimension)
        bit += 1
    return result


@njit(cache=True)
def _morton_keys(points: np.ndarray, lower: np.ndarray, inverse: np.ndarray, shape: np.ndarray) -> np.ndarray:
    n, dimension = points.shape
    key = np.zeros(n, np.int64)
    for axis in range(dimension):
        last, spread = np.int64(-1), np.int64(0)
        for i in range(n):
            c = cell_coordinate(points[i, axis], lower[axis], inverse[axis], shape[axis])
            if c != last:
                last, spread = c, _spread(c, dimension) << axis
            key[i] |= spread
    return key


def order_along_cells(points: np.ndarray, cell: float) -> np.ndarray:
    """Order that puts points along a space-filling (Morton) curve of cells.

    points (n, d) [m], cell the edge of a cell [m], widened where an axis would have more than 2**(62 // d) of them.
    Returns a permutation (n,) int64; points of one cell keep their order. Raises ValueError for a coordinate that is
    not finite or a cell that is not positive. Source: Morton, "A computer oriented geodetic data base", 1966.
    """
    points = checked_points(points)
    size = checked_length(cell, "cell")
    lower, upper = checked_bounds(points)
    most = 1 << min(62 // points.shape[1], 31)
    return stable_order(_morton_keys(points, *grid(lower, upper, size, most))).astype(np.int64)


@njit(cache=True)
def _fullest(begin: np.ndarray) -> int:
    """Points in the cell that has most, at least 1."""
    most = 1
    for cell in range(len(begin) - 1):
        most = max(most, begin[cell + 1] - begin[cell])
    return most


@njit(cache=True)
def _visit(cells: Cells, points: np.ndarray, reach: float, at: np.ndarray, neighbour: Any) -> None:
    """Walk through all pairs of a point b and an earlier one a within reach.

    neighbour: None to count them in `at`, the points a in the order of the cells; or where b is appended, in rising
    order, to the row of a, and `at` is where each row goes on.
    """
    square = reach * reach
    place = np.full(3, -9)
    place[points.shape[1] :] = 0
    near = np.empty((27, 2), np.int64)
    hits: Any = None if neighbour is None else np.empty(_fullest(cells.begin), np.int32)
    found = 0
    for b in range(len(points)):
        if locate(cells, points[b], place):
            found = surround(cells, place, near)
        x = points[b, 0]
        y = points[b, 1] if points.shape[1] > 1 else 0.0
        z = points[b, 2] if points.shape[1] > 2 else 0.0
        for s in range(found):
            first = np.uintp(near[s, 0])
            # points of a cell are in input order: if its first is later than b, so are all
            if cells.order[first] >= b:
                continue
            hit = np.uintp(0)
            for i in range(first, np.uintp(near[s, 1])):
                dx, dy, dz = x - cells.x[i], y - cells.y[i], z - cells.z[i]
                close = (dx * dx + dy * dy + dz * dz < square) & (cells.order[i] < b)
                if neighbour is None:
                    at[i] += close
                else:
                    # without a branch, for most are misses
                    hits[hit] = cells.order[i]
                    hit += np.uintp(close)
            if neighbour is not None:
                for h in range(hit):
                    a = np.uintp(hits[h])
                    neighbour[np.uintp(at[a])] = b
                    at[a] += 1


@njit(cache=True)
def _row_starts(order: np.ndarray, count: np.ndarray) -> np.ndarray:
    start = np.zeros(len(order) + 1, np.int64)
    for i in range(len(order)):
        start[order[i] + 1] = count[i]
    for a in range(len(order)):
        start[a + 1] += start[a]
    return start


def half_pairs(points: np.ndarray, owned: int, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Every pair of points closer than `reach`, once, in compressed rows.

    points (n, d) [m], d = 1, 2 or 3: the first `owned` rows are the rank's own, the others ghosts. reach [m].
    Returns start (owned + 1,) int64 and neighbour (m,) int32: those of a are neighbour[start[a]:start[a + 1]], rising,
    all behind a; so a pair of owned points stands once, under the first, and one with a ghost under the owned one.
    Pairs of ghosts are left out. Points at one place are a pair. Linear time where the points in a cell are bounded;
    about 60 bytes a point beside the result. Fastest when the points are ordered by `order_along_cells`.
    Raises ValueError for a bad shape, an `owned` outside 0..n, a reach that is not positive, a coordinate not finite.
    """
    points = checked_points(points)
    reach = checked_length(reach, "reach")
    if not 0 <= owned <= len(points):
        raise ValueError(f"owned: expected 0 to {len(points)} (the number of points), found {owned}")
    checked_bounds(points)
    cells = build_cells(points[:owned], reach)
    count = np.zeros(len(cells.order), np.int32)
    _visit(cells, points, reach, count, None)
    start = _row_starts(cells.order, count)
    neighbour = np.empty(start[-1], np.int32)
    _visit(cells, points, reach, start[:-1].copy(), neighbour)
    return start, neighbour
