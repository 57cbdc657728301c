"""Pairs of points closer than the sum of their radii, in one, two or three dimensions, in compressed rows.

    ClosePairs     all pairs of points and ghosts, or pairs across two sets of points, found again as they move
    half_pairs     all pairs within one reach, in rising rows
    within_reach   which points have any of another set within reach

Points are sorted by strips and finely along them; the points that may be close to one of them then lie in a few windows
of the sorted order, whose ends only move forward as one goes along it. So there is neither grid nor table, and the time
is linear however scattered the points are.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

# length of a cell along its strip in widths of the strip
_ALONG = 0.125
# relative to the cells; more than the rounding of a cell's number below _MOST_CELLS
_ROUNDING, _MOST_CELLS = 1e-9, 1 << 20
# bits of a turn of the sort
_DIGIT = 11
_BUCKETS = 1 << _DIGIT

# pairs of boxes that a sweep looks at in one piece
_AT_ONCE = 1 << 18


def checked_points(points: np.ndarray, name: str = "points") -> np.ndarray:
    """The points as a contiguous (n, d) float64 array, d = 1, 2 or 3. Raises ValueError for another shape."""
    # numba compiles the kernels for one layout only
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2 or not 1 <= points.shape[1] <= 3:
        raise ValueError(f"{name}: expected shape (n, d) with d = 1, 2 or 3, found {points.shape}")
    if len(points) >= 2**31:
        raise ValueError(f"{name}: expected fewer than 2**31 on one rank, found {len(points)}")
    return points


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


class Strips(NamedTuple):
    """How points are sorted: axes (d,), along the strips first; corner [m], 1 / cell [1/m] and cells (d,) along them.

    windows (w, 2): first and last key, less that of a point, of the cells around it.
    """

    axes: np.ndarray
    lower: np.ndarray
    inverse: np.ndarray
    shape: np.ndarray
    windows: np.ndarray

    def order(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Order (n,) int32 that sorts the points, and the keys (n,) as they stand."""
        key = _keys(points, self.axes, self.lower, self.inverse, self.shape)
        return stable_order(key.copy()), key


class _Sorted(NamedTuple):
    """Points in the sorted order: row, key, coordinates and radius of each."""

    row: np.ndarray
    key: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    radius: np.ndarray


@njit(cache=True)
def _keys(
    points: np.ndarray, axes: np.ndarray, lower: np.ndarray, inverse: np.ndarray, shape: np.ndarray
) -> np.ndarray:
    """Number of each point's cell, along axes[0] first."""
    key = np.empty(len(points), np.int64)
    for i in range(len(points)):
        k = np.int64(0)
        for turn in range(len(axes) - 1, -1, -1):
            k = k * shape[turn] + np.int64((points[i, axes[turn]] - lower[turn]) * inverse[turn])
        key[i] = k
    return key


@njit(cache=True)
def _sorted(points: np.ndarray, radius: np.ndarray, first: int, order: np.ndarray, keys: np.ndarray) -> _Sorted:
    """The points `order` of those given, whose rows are counted from `first`."""
    n, d = len(order), points.shape[1]
    row, key, x, y, z, r = (
        np.empty(n, np.int32),
        np.empty(n, np.int64),
        np.empty(n),
        np.zeros(n),
        np.zeros(n),
        np.empty(n),
    )
    for i in range(n):
        p = order[i]
        row[i], key[i], x[i], r[i] = first + p, keys[p], points[p, 0], radius[p]
        if d > 1:
            y[i] = points[p, 1]
        if d > 2:
            z[i] = points[p, 2]
    return _Sorted(row, key, x, y, z, r)


@njit(cache=True)
def _emit(
    points: _Sorted, others: _Sorted, windows: np.ndarray, later: bool, hits: np.ndarray, begin: np.ndarray
) -> np.ndarray:
    """Append the rows of the others that are close to each point to `hits`; begin (n + 1,): where each point's start.

    later: the others are the points, and only those after a point in the sorted order count.
    Returns the hits, in a longer array where they did not fit.
    """
    low, high = np.zeros(len(windows), np.int64), np.zeros(len(windows), np.int64)
    m, at = len(others.row), np.int64(0)
    close = np.empty(64, np.uint8)
    for i in range(len(points.row)):
        candidates = 0
        for w in range(len(windows)):
            first, last = points.key[i] + windows[w, 0], points.key[i] + windows[w, 1]
            start, end = low[w], high[w]
            while start < m and others.key[start] < first:
                start += 1
            while end < m and others.key[end] <= last:
                end += 1
            low[w], high[w] = start, end
            candidates += max(end - start, 0)
        if later:
            # the first window is that of the point's own strip
            low[0] = i + 1
        begin[i] = at
        if at + candidates > len(hits):
            longer = np.empty(2 * len(hits) + candidates, np.int32)
            # numba takes 2 s to compile an assignment of slices
            for k in range(at):
                longer[k] = hits[k]
            hits = longer
        if candidates > len(close):
            close = np.empty(2 * candidates, np.uint8)
        here: Any = np.uintp(at)
        x, y, z, radius = points.x[i], points.y[i], points.z[i], points.radius[i]
        for w in range(len(windows)):
            start, count = np.uintp(low[w]), np.uintp(max(high[w] - low[w], 0))
            # the distances in vectors, then the hits without a branch, for every other is a miss
            for j in range(count):
                dx, dy, dz = x - others.x[start + j], y - others.y[start + j], z - others.z[start + j]
                reach = radius + others.radius[start + j]
                close[j] = dx * dx + dy * dy + dz * dz < reach * reach
            for j in range(count):
                hits[here] = others.row[start + j]
                here += np.uintp(close[j])
        at = np.int64(here)
    begin[len(points.row)] = at
    return hits


@njit(cache=True)
def _in_rows(row: np.ndarray, hits: np.ndarray, begin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The hits of sorted points in compressed rows."""
    n = len(row)
    start = np.zeros(n + 1, np.int64)
    for i in range(n):
        start[row[i] + 1] = begin[i + 1] - begin[i]
    for a in range(n):
        start[a + 1] += start[a]
    neighbour = np.empty(start[n], np.int32)
    for i in range(n):
        at = start[row[i]] - begin[i]
        for k in range(begin[i], begin[i + 1]):
            neighbour[at + k] = hits[k]
    return start, neighbour


def strips_of(lower: np.ndarray, upper: np.ndarray, reach: float) -> Strips:
    """Strips along the shortest side of a box (d,) [m] for points that are close within a reach [m] at most."""
    axes = np.argsort(upper - lower, kind="stable")
    low, extent = lower[axes], (upper - lower)[axes]
    wanted = np.full(len(axes), reach * (1.0 + 2.0 * _ROUNDING))
    wanted[0] *= _ALONG
    inverse = 1.0 / np.maximum(wanted, extent / _MOST_CELLS)
    shape = np.floor(extent * inverse).astype(np.int64) + 1
    across = np.minimum(np.ceil(reach * (1.0 + _ROUNDING) * inverse[1:]), shape[1:]).astype(np.int64)
    along = min(int(reach * (1.0 + _ROUNDING) * inverse[0]) + 1, int(shape[0]))
    # so that no two windows share a cell
    shape[0] += 2 * along
    shape[1:] += 2 * across
    stride = np.cumprod(np.concatenate(([1], shape[:-1])))[1:]
    middle = np.zeros(1, np.int64)
    for cells, step in zip(across, stride):
        middle = (middle[:, None] + np.arange(-cells, cells + 1) * step).ravel()
    windows = np.sort(middle)[:, None] + np.array([-along, along])
    return Strips(axes, low, inverse, shape, windows)


class ClosePairs:
    """Finds pairs of points closer than the sum of their radii; keeps its buffer from one search to the next."""

    def __init__(self) -> None:
        """No points yet."""
        self._hits = np.empty(1024, np.int32)

    def find(self, points: np.ndarray, radius: np.ndarray, owned: int) -> tuple[np.ndarray, ...]:
        """Every pair with an owned point once, in compressed rows.

        points (n, d) [m], d = 1, 2 or 3, of which the first `owned` are the rank's own, the others ghosts; radius (n,)
        [m], positive. Returns start (owned + 1,) int64, neighbour (m,) int32 of pairs of owned points, each under the
        first of them in the sorted order, then the same of owned points and ghosts. Neighbours stand in the sorted
        order. Points a, b are a pair where |x_a - x_b| < r_a + r_b, to the bit the same for both and on all ranks;
        points at one place are one. Raises ValueError for a bad shape, an `owned` outside 0..n, a coordinate not
        finite, a radius that is not positive.
        """
        points = checked_points(points)
        if not 0 <= owned <= len(points):
            raise ValueError(f"owned: expected 0 to {len(points)} (the number of points), found {owned}")
        if radius.shape != (len(points),) or not ((radius > 0.0) & (radius < np.inf)).all():
            raise ValueError(f"radius: expected {len(points)} positive finite lengths, found {radius}")
        bounds = checked_bounds(points)
        if owned == 0:
            nothing = np.zeros(1, np.int64), np.empty(0, np.int32)
            return (*nothing, *nothing)
        strips = strips_of(*bounds, 2.0 * float(radius.max()))
        radius = np.ascontiguousarray(radius)
        own = _sorted(points[:owned], radius[:owned], 0, *strips.order(points[:owned]))
        ghosts = _sorted(points[owned:], radius[owned:], owned, *strips.order(points[owned:]))
        forward = strips.windows[strips.windows[:, 1] >= 0].copy()
        return (*self._rows(own, own, forward, True), *self._rows(own, ghosts, strips.windows, False))

    def across(
        self, points: np.ndarray, radius: np.ndarray, others: np.ndarray, other_radius: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of points (n, d) [m] and others (m, d) with radii (n,), (m,) [m]: start (n + 1,) and rows of the others
        int32, as `find` gives them for owned points and ghosts.
        """
        if not (len(points) and len(others)):
            return np.zeros(len(points) + 1, np.int64), np.empty(0, np.int32)
        reach = float(radius.max() + other_radius.max())
        strips, first, second = _two_sets(points, radius, others, other_radius, reach)
        return self._rows(first, second, strips.windows, False)

    def _rows(self, own: _Sorted, others: _Sorted, windows: np.ndarray, later: bool) -> tuple[np.ndarray, np.ndarray]:
        begin = np.zeros(len(own.row) + 1, np.int64)
        if len(others.row):
            self._hits = _emit(own, others, windows, later, self._hits, begin)
        start, neighbour = _in_rows(own.row, self._hits, begin)
        return start, neighbour


@njit(cache=True)
def _rising_rows(lists: tuple[np.ndarray, ...], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Each pair under the first of its points, neighbours rising; lists: those of `find`; count: of all points."""
    start, neighbour, outer_start, outer = lists
    n = len(start) - 1
    # the other way round first: under its last point; then rows rise when these are taken one after the other
    below = np.zeros(count + 1, np.int64)
    above = np.zeros(n + 1, np.int64)
    for a in range(n):
        for k in range(start[a], start[a + 1]):
            below[max(a, neighbour[k]) + 1] += 1
            above[min(a, neighbour[k]) + 1] += 1
        for k in range(outer_start[a], outer_start[a + 1]):
            below[outer[k] + 1] += 1
        above[a + 1] += outer_start[a + 1] - outer_start[a]
    for b in range(count):
        below[b + 1] += below[b]
    for a in range(n):
        above[a + 1] += above[a]
    first, place = np.empty(below[count], np.int32), below[:-1].copy()
    for a in range(n):
        for k in range(start[a], start[a + 1]):
            b = max(a, neighbour[k])
            first[place[b]] = min(a, neighbour[k])
            place[b] += 1
        for k in range(outer_start[a], outer_start[a + 1]):
            first[place[outer[k]]] = a
            place[outer[k]] += 1
    result, place = np.empty(above[n], np.int32), above[:-1].copy()
    for b in range(count):
        for k in range(below[b], below[b + 1]):
            result[place[first[k]]] = b
            place[first[k]] += 1
    return above, result


def half_pairs(points: np.ndarray, owned: int, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Every pair of points closer than `reach` [m] with an owned one, once, under the first of them, neighbours rising.

    points, owned: as in `ClosePairs.find`. Returns start (owned + 1,) int64 and neighbour (m,) int32, all behind the
    point of their row: so a pair of owned points stands under the first, and one with a ghost under the owned one.
    Raises ValueError as `find` does, and for a reach that is not positive and finite.
    """
    if not 0.0 < reach < np.inf:
        raise ValueError(f"reach: expected a positive finite length, found {reach!r}")
    lists = ClosePairs().find(points, np.full(len(points), 0.5 * reach), owned)
    return _rising_rows(lists, len(points))


@njit(cache=True)
def _have_near(points: _Sorted, others: _Sorted, windows: np.ndarray, reach: float) -> np.ndarray:
    low, high = np.zeros(len(windows), np.int64), np.zeros(len(windows), np.int64)
    result, m = np.zeros(len(points.row), np.bool_), len(others.row)
    for i in range(len(points.row)):
        near = False
        for w in range(len(windows)):
            first, last = points.key[i] + windows[w, 0], points.key[i] + windows[w, 1]
            while low[w] < m and others.key[low[w]] < first:
                low[w] += 1
            while high[w] < m and others.key[high[w]] <= last:
                high[w] += 1
            for j in range(low[w], high[w]):
                dx, dy, dz = points.x[i] - others.x[j], points.y[i] - others.y[j], points.z[i] - others.z[j]
                if dx * dx + dy * dy + dz * dz < reach * reach:
                    near = True
                    break
            if near:
                break
        result[points.row[i]] = near
    return result


def within_reach(points: np.ndarray, others: np.ndarray, reach: float) -> np.ndarray:
    """Which of the points (n, d) are closer than `reach` to one of the others (m, d): bool (n,)."""
    if not (len(points) and len(others)):
        return np.zeros(len(points), bool)
    strips, first, second = _two_sets(points, np.zeros(len(points)), others, np.zeros(len(others)), reach)
    return _have_near(first, second, strips.windows, reach)


def _two_sets(
    points: np.ndarray, radius: np.ndarray, others: np.ndarray, other_radius: np.ndarray, reach: float
) -> tuple[Strips, _Sorted, _Sorted]:
    """Two sets of points in the same strips."""
    points, others = checked_points(points), checked_points(others)
    (lower, upper), (other_lower, other_upper) = checked_bounds(points), checked_bounds(others)
    strips = strips_of(np.minimum(lower, other_lower), np.maximum(upper, other_upper), reach)
    first = _sorted(points, np.ascontiguousarray(radius), 0, *strips.order(points))
    return strips, first, _sorted(others, np.ascontiguousarray(other_radius), 0, *strips.order(others))


def close_boxes(lower: np.ndarray, upper: np.ndarray, distance: Any) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of each two boxes (n, d) [m] that are less than a distance [m] apart along every axis, the lower first,
    by a sweep along the axis in which boxes lie farthest apart. distance: one, or (n,), half the sum of both."""
    count, half = len(lower), 0.5 * np.broadcast_to(np.asarray(distance, float), len(lower))[:, None]
    lower, upper = lower - half, upper + half
    axis = int(np.argmax(np.ptp(lower + upper, axis=0))) if count and np.isfinite(half).all() else 0
    order = np.argsort(lower[:, axis], kind="stable")
    low, high = lower[order], upper[order]
    ends = np.maximum(np.searchsorted(low[:, axis], high[:, axis], "right") - np.arange(count) - 1, 0)
    before, found = np.concatenate(([0], np.cumsum(ends))), [np.zeros((2, 0), np.int64)]
    start = 0
    while start < count:
        # so many boxes at once as keeps arrays small
        stop = max(int(np.searchsorted(before, before[start] + _AT_ONCE, "right")) - 1, start + 1)
        one = np.repeat(np.arange(start, stop), ends[start:stop])
        other = one + 1 + np.arange(len(one)) - np.repeat(before[start:stop] - before[start], ends[start:stop])
        meet = ((low[other] <= high[one]) & (low[one] <= high[other])).all(axis=1)
        found.append(np.sort(order[np.stack((one[meet], other[meet]))], axis=0))
        start = stop
    first, second = np.concatenate(found, axis=1)
    return first, second
