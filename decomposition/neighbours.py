"""Neighbour search by cell lists, and the order along cells that keeps neighbours close in memory."""

import numpy as np

from decomposition.compiled import compiled

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


@compiled
def _spread(value: int, dimension: int) -> np.int64:
    """The bits of a cell number, `dimension` places apart."""
    result = np.int64(0)
    bit = 0
    while value >> bit > 0:
        result |= ((value >> bit) & 1) << (bit * dimension)
        bit += 1
    return result


@compiled
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


@compiled
def _nowhere(dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """The cell of no point yet, and room for the ranges of points in the cells around one."""
    place = np.full(3, -9)
    place[dimension:] = 0
    return place, np.empty((27, 2), np.int64)


@compiled
def _around(cells: Cells, point: np.ndarray, place: np.ndarray, near: np.ndarray, found: int) -> int:
    """How many cells surround a point; `near` is what it was where the point is in the same cell as the one before."""
    return surround(cells, place, near) if locate(cells, point, place) else found


@compiled
def _coordinates(points: np.ndarray, b: int) -> tuple[float, float, float]:
    """Three coordinates in any dimension."""
    y = points[b, 1] if points.shape[1] > 1 else 0.0
    z = points[b, 2] if points.shape[1] > 2 else 0.0
    return points[b, 0], y, z


@compiled
def _earlier(cells: Cells, span: np.ndarray, b: int) -> tuple[np.uintp, np.uintp]:
    """The points of a cell that may be earlier than b; none when its first is later, for they are in input order."""
    first = np.uintp(span[0])
    return first, first if cells.order[first] >= b else np.uintp(span[1])


@compiled
def _count(cells: Cells, points: np.ndarray, reach: float) -> np.ndarray:
    """How many later points are within reach of each point of the cells, in the order of the cells."""
    count = np.zeros(len(cells.order), np.int32)
    square = reach * reach
    place, near = _nowhere(points.shape[1])
    found = 0
    for b in range(len(points)):
        found = _around(cells, points[b], place, near, found)
        x, y, z = _coordinates(points, b)
        for s in range(found):
            first, last = _earlier(cells, near[s], b)
            for i in range(first, last):
                dx, dy, dz = x - cells.x[i], y - cells.y[i], z - cells.z[i]
                count[i] += (dx * dx + dy * dy + dz * dz < square) & (cells.order[i] < b)
    return count


@compiled
def _fill(cells: Cells, points: np.ndarray, reach: float, cursor: np.ndarray, neighbour: np.ndarray) -> None:
    """Append b, in rising order, to the row of every earlier point within reach; cursor is where each row goes on."""
    square = reach * reach
    place, near = _nowhere(points.shape[1])
    hits = np.empty(np.diff(cells.begin).max() if len(cells.begin) > 1 else 1, np.int32)
    found = 0
    for b in range(len(points)):
        found = _around(cells, points[b], place, near, found)
        x, y, z = _coordinates(points, b)
        for s in range(found):
            hit = np.uintp(0)
            first, last = _earlier(cells, near[s], b)
            for i in range(first, last):
                dx, dy, dz = x - cells.x[i], y - cells.y[i], z - cells.z[i]
                # without a branch, for most are misses
                hits[hit] = cells.order[i]
                hit += np.uintp((dx * dx + dy * dy + dz * dz < square) & (cells.order[i] < b))
            for h in range(hit):
                a = np.uintp(hits[h])
                neighbour[np.uintp(cursor[a])] = b
                cursor[a] += 1


@compiled
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
    start = _row_starts(cells.order, _count(cells, points, reach))
    neighbour = np.empty(start[-1], np.int32)
    _fill(cells, points, reach, start[:-1].copy(), neighbour)
    return start, neighbour
