"""Cell lists over points in one, two or three dimensions, for numba code; linear time, memory linear in the points.

Only cells that hold points are stored, behind a hash table, so points may be as scattered as they like.
Missing dimensions are one cell thick.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

_DIGIT = 11
_BUCKETS = 1 << _DIGIT
_MOST_CELLS = 1 << 20
# wider than the reach by more than the rounding of a cell coordinate below _MOST_CELLS
_MARGIN = 1.0 + 2e-9


class Cells(NamedTuple):
    """Points sorted by cell, in input order within a cell."""

    lower: np.ndarray
    inverse: np.ndarray
    shape: np.ndarray
    order: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    key: np.ndarray
    begin: np.ndarray
    table: np.ndarray


def checked_points(points: np.ndarray, name: str = "points") -> np.ndarray:
    """The points as a contiguous (n, d) float64 array, d = 1, 2 or 3. Raises ValueError for another shape."""
    # numba compiles the kernels for one layout only
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2 or not 1 <= points.shape[1] <= 3:
        raise ValueError(f"{name}: expected shape (n, d) with d = 1, 2 or 3, found {points.shape}")
    if len(points) >= 2**31:
        raise ValueError(f"{name}: expected fewer than 2**31 on one rank, found {len(points)}")
    return points


def checked_length(length: float, name: str) -> float:
    """The length as a float. Raises ValueError unless it is positive and finite."""
    if not 0.0 < length < np.inf:
        raise ValueError(f"{name}: expected a positive finite length, found {length!r}")
    return float(length)


@njit(cache=True)
def bounds(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (d,), inf and -inf without points; NaN where a coordinate is not finite."""
    dimension = points.shape[1]
    lower = np.full(dimension, np.inf)
    upper = np.full(dimension, -np.inf)
    for i in range(len(points)):
        for k in range(dimension):
            x = points[i, k]
            if not np.isfinite(x):
                lower[k] = upper[k] = np.nan
                return lower, upper
            lower[k] = min(lower[k], x)
            upper[k] = max(upper[k], x)
    return lower, upper


def checked_bounds(points: np.ndarray, name: str = "points") -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner. Raises ValueError for a coordinate that is not finite."""
    lower, upper = bounds(points)
    if np.isnan(lower).any():
        row = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise ValueError(f"{name}: expected finite coordinates, found {points[row]} in row {row}")
    return lower, upper


@njit(cache=True)
def stable_order(key: np.ndarray) -> np.ndarray:
    """Order (int32) that sorts non-negative int64 keys, equal ones as they came; a radix sort. Overwrites the keys."""
    n = len(key)
    # loops in place of numpy's functions, which load a tenth of numba with the kernel
    order, largest = np.empty(n, np.int32), 0
    for i in range(n):
        order[i] = i
        largest = max(largest, key[i])
    other_key = np.empty_like(key)
    other = np.empty_like(order)
    count = np.empty(_BUCKETS, np.int64)
    shift = 0
    while shift < 63 and largest >> shift > 0:
        count[:] = 0
        for i in range(n):
            count[(key[i] >> shift) & (_BUCKETS - 1)] += 1
        total = 0
        for k in range(_BUCKETS):
            here = count[k]
            count[k] = total
            total += here
        for i in range(n):
            k = (key[i] >> shift) & (_BUCKETS - 1)
            other_key[count[k]] = key[i]
            other[count[k]] = order[i]
            count[k] += 1
        key, other_key = other_key, key
        order, other = other, order
        shift += _DIGIT
    return order


@njit(cache=True)
def cell_coordinate(x: float, lower: float, inverse: float, shape: int) -> np.int64:
    """Cell number along one axis; -2 or shape + 1 when it is farther out than that."""
    return np.int64(min(max(np.floor((x - lower) * inverse), -2.0), shape + 1.0))


@njit(cache=True)
def _slot(key: int, mask: int) -> np.int64:
    """First place to look for a cell's key in the hash table."""
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    return np.int64(mixed >> np.uint64(32)) & mask


@njit(cache=True)
def _find(cells: Cells, key: int) -> int:
    """Which stored cell has this key, or -1."""
    mask = len(cells.table) - 1
    slot = _slot(key, mask)
    while True:
        cell = cells.table[slot]
        if cell < 0 or cells.key[cell] == key:
            return cell
        slot = (slot + 1) & mask


@njit(cache=True)
def _keys(points: np.ndarray, lower: np.ndarray, inverse: np.ndarray, shape: np.ndarray) -> np.ndarray:
    key = np.empty(len(points), np.int64)
    for i in range(len(points)):
        k = np.int64(0)
        for axis in range(points.shape[1] - 1, -1, -1):
            k = k * shape[axis] + cell_coordinate(points[i, axis], lower[axis], inverse[axis], shape[axis])
        key[i] = k
    return key


@njit(cache=True)
def _coordinate(points: np.ndarray, order: np.ndarray, axis: int) -> np.ndarray:
    result = np.zeros(len(order))
    if axis < points.shape[1]:
        for i in range(len(order)):
            result[i] = points[order[i], axis]
    return result


@njit(cache=True)
def _occupied(key: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Keys of cells that hold points, where each begins in the order, and the hash table over them."""
    n = len(order)
    found = 0
    for i in range(n):
        found += i == 0 or key[order[i]] != key[order[i - 1]]
    cell_key = np.empty(found, np.int64)
    begin = np.empty(found + 1, np.int64)
    found = 0
    for i in range(n):
        if i == 0 or key[order[i]] != key[order[i - 1]]:
            cell_key[found] = key[order[i]]
            begin[found] = i
            found += 1
    begin[found] = n
    size = 8
    while size < 2 * found:
        size *= 2
    table = np.full(size, -1, np.int32)
    for cell in range(found):
        slot = _slot(cell_key[cell], size - 1)
        while table[slot] >= 0:
            slot = (slot + 1) & (size - 1)
        table[slot] = cell
    return cell_key, begin, table


@njit(cache=True)
def _build(points: np.ndarray, lower: np.ndarray, inverse: np.ndarray, shape: np.ndarray) -> Cells:
    key = _keys(points, lower, inverse, shape)
    order = stable_order(key.copy())
    cell_key, begin, table = _occupied(key, order)
    x, y, z = _coordinate(points, order, 0), _coordinate(points, order, 1), _coordinate(points, order, 2)
    return Cells(lower, inverse, shape, order, x, y, z, cell_key, begin, table)


def grid(lower: np.ndarray, upper: np.ndarray, size: float, most: int) -> tuple[np.ndarray, ...]:
    """Lower corner, 1 / cell size and number of cells, each (3,): cells of at least `size`, at most `most` an axis."""
    corner, inverse, shape = np.zeros(3), np.ones(3), np.ones(3, np.int64)
    if np.all(lower <= upper):
        d = len(lower)
        corner[:d] = lower
        inverse[:d] = 1.0 / np.maximum(size, (upper - lower) / (most - 1))
        shape[:d] = np.floor((upper - lower) * inverse[:d]).astype(np.int64) + 1
    return corner, inverse, shape


def build_cells(points: np.ndarray, reach: float) -> Cells:
    """Cells in which any two points closer than `reach` lie in the same or in touching cells.

    points (n, d) float64. Raises ValueError for a coordinate that is not finite.
    """
    lower, upper = checked_bounds(points)
    return _build(points, *grid(lower, upper, reach * _MARGIN, _MOST_CELLS))


@njit(cache=True)
def locate(cells: Cells, point: np.ndarray, place: np.ndarray) -> bool:
    """Put a point's cell coordinates into `place` (3,); True if they changed."""
    changed = False
    for axis in range(len(point)):
        c = cell_coordinate(point[axis], cells.lower[axis], cells.inverse[axis], cells.shape[axis])
        changed |= c != place[axis]
        place[axis] = c
    return changed


@njit(cache=True)
def surround(cells: Cells, place: np.ndarray, near: np.ndarray) -> int:
    """Fill near (27, 2) with [begin, end) in the order of the occupied cells that touch `place`; return how many."""
    found = 0
    nx, ny, nz = cells.shape
    for cz in range(max(place[2] - 1, 0), min(place[2] + 2, nz)):
        for cy in range(max(place[1] - 1, 0), min(place[1] + 2, ny)):
            for cx in range(max(place[0] - 1, 0), min(place[0] + 2, nx)):
                cell = _find(cells, (cz * ny + cy) * nx + cx)
                if cell >= 0:
                    near[found, 0] = cells.begin[cell]
                    near[found, 1] = cells.begin[cell + 1]
                    found += 1
    return found


@njit(cache=True)
def _within(cells: Cells, points: np.ndarray, reach: float) -> np.ndarray:
    result = np.zeros(len(points), np.bool_)
    place = np.full(3, -9)
    place[points.shape[1] :] = 0
    near = np.empty((27, 2), np.int64)
    found = 0
    for a in range(len(points)):
        if locate(cells, points[a], place):
            found = surround(cells, place, near)
        x = points[a, 0]
        y = points[a, 1] if points.shape[1] > 1 else 0.0
        z = points[a, 2] if points.shape[1] > 2 else 0.0
        for s in range(found):
            for i in range(near[s, 0], near[s, 1]):
                dx, dy, dz = x - cells.x[i], y - cells.y[i], z - cells.z[i]
                if dx * dx + dy * dy + dz * dz < reach * reach:
                    result[a] = True
                    break
            if result[a]:
                break
    return result


def within_reach(points: np.ndarray, others: np.ndarray, reach: float) -> np.ndarray:
    """Which of the points (n, d) are closer than `reach` to one of the others (m, d): bool (n,)."""
    return _within(build_cells(others, reach), points, reach)
