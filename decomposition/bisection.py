"""Weighted recursive coordinate bisection in parallel; no rank ever holds all points.

Source: M. J. Berger and S. H. Bokhari, "A partitioning strategy for nonuniform problems on multiprocessors", IEEE
Transactions on Computers C-36 (1987). All parts of a level are cut at once. Points and cells are cut by the same whole
numbers, their keys: a cell's are its indices, a point's the bits of its coordinates, in the order of these. A cut is
found exactly, by histograms over the bits of the keys. Keys tied on the cut are told apart along the other axes: a cut
is a plane with one step in it, so that parts can be as equal as cells, or points, allow. Points at one place are told
apart by rank and row, so that lattices, too, are cut to the particle.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI
from numba import njit

from .pair_search import bounds, checked_points
from .timer import COMMUNICATION

# histogram entries of a level, shared by its parts, and the most and fewest bits of a turn
_ENTRIES, _MOST_BITS, _FEWEST_BITS = 1 << 16, 8, 2
# total weight in integer units: exact sums in any order, and room for rounding up
_UNITS = 2.0**61
_TIED, _LEFT, _RIGHT = np.int8(0), np.int8(1), np.int8(2)
_LARGEST = np.int64(2**63 - 1)


def keys_of(points: np.ndarray) -> np.ndarray:
    """Whole numbers (n, d) in the order of coordinates (n, d); the zeros of both signs are one."""
    bits = (points + 0.0).view(np.int64)
    return np.asarray(bits ^ ((bits >> 63) & _LARGEST))


def places_of(keys: np.ndarray) -> np.ndarray:
    """The coordinates of `keys_of`."""
    return np.asarray(np.ascontiguousarray(keys ^ ((keys >> 63) & _LARGEST)).view(np.float64))


# --- the cuts of all ranks ----------------------------------------------------------------------------------------


@njit(cache=True)
def _before(key: np.ndarray, axes: np.ndarray, cut: np.ndarray) -> bool:
    """Whether a key comes before a cut, axis by axis."""
    for k in range(len(cut)):
        if key[axes[k]] != cut[k]:
            return key[axes[k]] < cut[k]
    return False


@njit(cache=True)
def _owners(axes: np.ndarray, cuts: np.ndarray, keys: np.ndarray) -> np.ndarray:
    result = np.zeros(len(keys), np.int32)
    for n in range(len(keys)):
        first, last = 0, len(cuts) + 1
        while last - first > 1:
            middle = first + (last - first) // 2
            if _before(keys[n], axes[middle - 1], cuts[middle - 1]):
                last = middle
            else:
                first = middle
        result[n] = first
    return result


@njit(cache=True)
def _overlapping(axes: np.ndarray, cuts: np.ndarray, lower: np.ndarray, upper: np.ndarray, here: int) -> np.ndarray:
    """Pairs (row of a box, other rank) for ranks that may own one of the keys lower .. upper."""
    found, count = np.empty((64, 2), np.int64), 0
    waiting = np.empty((128, 2), np.int64)
    for n in range(len(lower)):
        depth = 1
        waiting[0, 0], waiting[0, 1] = 0, len(cuts) + 1
        while depth:
            depth -= 1
            first, last = waiting[depth, 0], waiting[depth, 1]
            if last - first == 1:
                if first != here:
                    if count == len(found):
                        found = np.concatenate((found, found))
                    found[count, 0], found[count, 1] = n, first
                    count += 1
                continue
            middle = first + (last - first) // 2
            # a box has its first and its last key at its corners
            if not _before(upper[n], axes[middle - 1], cuts[middle - 1]):
                waiting[depth, 0], waiting[depth, 1] = middle, last
                depth += 1
            if _before(lower[n], axes[middle - 1], cuts[middle - 1]):
                waiting[depth, 0], waiting[depth, 1] = first, middle
                depth += 1
    return found[:count]


class CutTree:
    """Owners of all keys, the same on every rank.

    Ranks first .. last-1 have a part of space together; the cut between first .. middle-1 and middle .. last-1, with
    middle = (first + last) // 2, is number middle - 1. axes (ranks - 1, d): the order in which a cut compares keys;
    cuts (ranks - 1, d): the first key on its right, in that order.
    """

    def __init__(self, axes: np.ndarray, cuts: np.ndarray, places: Callable[[np.ndarray], np.ndarray] | None = None):
        """places: coordinates of keys, the keys themselves unless given."""
        self.axes, self.cuts = np.asarray(axes, np.int64), np.asarray(cuts, np.int64)
        self.ranks = len(self.cuts) + 1
        first = self.cuts[:, :1]
        self._places = (places(first) if places else first.astype(np.float64)).ravel()

    @classmethod
    def whole(cls, dimension: int) -> "CutTree":
        """All to rank 0."""
        return cls(np.zeros((0, dimension)), np.zeros((0, dimension)))

    def state(self) -> dict[str, Any]:
        """As plain lists, for a file."""
        return {"axes": self.axes.tolist(), "cuts": self.cuts.tolist()}

    @classmethod
    def from_state(cls, state: dict[str, Any], dimension: int) -> "CutTree":
        """The tree of a `state`, of cells."""
        axes, cuts = (np.array(state[name], np.int64).reshape(-1, dimension) for name in ("axes", "cuts"))
        return cls(axes, cuts)

    def owners(self, keys: np.ndarray) -> np.ndarray:
        """Owner (n,) int32 of keys (n, d) int64."""
        return _owners(self.axes, self.cuts, keys)

    def touching(self, nodes: np.ndarray, width: int, here: int) -> np.ndarray:
        """Which other ranks may have cells whose stencil of `width` nodes a direction holds a node; a cell's stencil
        begins at the node of its own index. nodes (n, d); returns (m, 2): row of the node, rank; all true pairs and few
        others.
        """
        nodes = np.ascontiguousarray(nodes, np.int64)
        return _overlapping(self.axes, self.cuts, nodes - (width - 1), nodes, here)

    def overlapping(self, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Which ranks may own keys of boxes from lower to upper (n, d), both included: (m, 2): row of the box, rank;
        all true pairs and few others."""
        return _overlapping(self.axes, self.cuts, lower, upper, -1)

    def box(self, rank: int) -> np.ndarray:
        """Least box (2, d) around the part of a rank, infinite where the part is."""
        result = np.repeat([[-np.inf], [np.inf]], self.cuts.shape[1], axis=1)
        first, last = 0, self.ranks
        while last - first > 1:
            middle = first + (last - first) // 2
            axis, place = self.axes[middle - 1, 0], self._places[middle - 1]
            if rank < middle:
                last, result[1, axis] = middle, min(result[1, axis], place)
            else:
                first, result[0, axis] = middle, max(result[0, axis], place)
        return result

    def near(self, box: np.ndarray, reach: float) -> list[int]:
        """Ranks, rising, whose least boxes are within a reach of a box (2, d); visits only cuts near it."""
        found, waiting = [], [(0, self.ranks)]
        while waiting:
            first, last = waiting.pop()
            if last - first == 1:
                found.append(first)
                continue
            middle = first + (last - first) // 2
            axis, place = self.axes[middle - 1, 0], self._places[middle - 1]
            if place - box[1, axis] <= reach:
                waiting.append((middle, last))
            if box[0, axis] - place <= reach:
                waiting.append((first, middle))
        return found

    def neighbours(self, rank: int, reach: float) -> list[int]:
        """Other ranks, rising, that may own what is within a reach of a rank's part; mutual."""
        return [other for other in self.near(self.box(rank), reach) if other != rank]


# --- cutting ------------------------------------------------------------------------------------------------------


@njit(cache=True)
def _part_bounds(keys: np.ndarray, part: np.ndarray, parts: int) -> np.ndarray:
    """Lower and inverted upper corner of each part's keys: (parts, 2, d)."""
    result = np.full((parts, 2, keys.shape[1]), _LARGEST)
    for i in range(len(keys)):
        p = part[i]
        if p >= 0:
            for k in range(keys.shape[1]):
                result[p, 0, k] = min(result[p, 0, k], keys[i, k])
                result[p, 1, k] = min(result[p, 1, k], ~keys[i, k])
    return result


@njit(cache=True)
def _histogram(
    keys: np.ndarray,
    weights: np.ndarray,
    part: np.ndarray,
    side: np.ndarray,
    axis: np.ndarray,
    low: np.ndarray,
    shift: int,
    bins: int,
) -> np.ndarray:
    """Weight of the tied keys of each part in each bin of width 2**shift from `low`; those beyond the bins at either
    end are left out.
    """
    result = np.zeros((len(axis), bins), np.int64)
    for i in range(len(keys)):
        p = part[i]
        if p < 0 or side[i] != _TIED or axis[p] < 0:
            continue
        key = keys[i, axis[p]]
        if key >= low[p]:
            # the difference of two keys may take 64 bits
            k = (np.uint64(key) - np.uint64(low[p])) >> np.uint64(shift)
            if k < np.uint64(bins):
                result[p, np.int64(k)] += weights[i]
    return result


@njit(cache=True)
def _split_tied(keys: np.ndarray, part: np.ndarray, side: np.ndarray, axis: np.ndarray, cut: np.ndarray) -> None:
    """Send tied keys beside the cut to their side; those on it stay tied."""
    for i in range(len(keys)):
        p = part[i]
        if p >= 0 and side[i] == _TIED and axis[p] >= 0:
            key = keys[i, axis[p]]
            if key != cut[p]:
                side[i] = _LEFT if key < cut[p] else _RIGHT


@njit(cache=True)
def _tied_weight(weights: np.ndarray, part: np.ndarray, side: np.ndarray, parts: int) -> np.ndarray:
    result = np.zeros(parts, np.int64)
    for i in range(len(part)):
        if part[i] >= 0 and side[i] == _TIED:
            result[part[i]] += weights[i]
    return result


@njit(cache=True)
def _split_by_row(
    weights: np.ndarray, part: np.ndarray, side: np.ndarray, before: np.ndarray, target: np.ndarray
) -> None:
    """Send points at one place left until the target is met, to the nearest particle."""
    for i in range(len(part)):
        p = part[i]
        if p >= 0 and side[i] == _TIED:
            # half the weight is rounded up: a point of weight 1 fits wholly or not at all
            side[i] = _LEFT if before[p] + (weights[i] + 1) // 2 <= target[p] else _RIGHT
            before[p] += weights[i]


@njit(cache=True)
def _descend(part: np.ndarray, side: np.ndarray, child: np.ndarray) -> None:
    for i in range(len(part)):
        if part[i] >= 0:
            part[i] = child[part[i], 0 if side[i] == _LEFT else 1]


def _reduced(comm: MPI.Intracomm, local: np.ndarray, operation: MPI.Op) -> np.ndarray:
    with COMMUNICATION:
        comm.Allreduce(MPI.IN_PLACE, local, operation)
    return local


class _Level:
    """The cuts of all parts of a level; every array has a row a part.

    order (parts, d): in which axes are compared, longest first; cut (parts, d): the first key on the right; side: of
    every key, 0 for those on the cut; target: the weight of those that belongs on the left.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        keys: np.ndarray,
        weights: np.ndarray,
        part: np.ndarray,
        ranks: np.ndarray,
        places: Callable[[np.ndarray], np.ndarray],
    ) -> None:
        """ranks (parts, 2): first and end of each part's."""
        self.comm, self.keys, self.weights, self.part, self.parts = comm, keys, weights, part, len(ranks)
        self.side = np.zeros(len(keys), np.int8)
        box = _reduced(comm, _part_bounds(keys, part, self.parts), MPI.MIN)
        self.lower, self.upper = box[:, 0], ~box[:, 1]
        total = self.tied()
        self.filled = total > 0
        middle = ranks[:, 0] + (ranks[:, 1] - ranks[:, 0]) // 2
        whole, share = np.maximum(ranks[:, 1] - ranks[:, 0], 1), middle - ranks[:, 0]
        # total * share // whole without overflow
        self.target = total // whole * share + total % whole * share // whole
        extent = np.where(self.filled[:, None], places(self.upper) - places(self.lower), 0.0)
        self.order = np.argsort(-extent, axis=1, kind="stable")
        # parts without keys are those of their first rank
        self.cut = np.full(self.order.shape, _LARGEST)
        for turn in range(keys.shape[1]):
            self._cut_along(turn)

    def tied(self) -> np.ndarray:
        """Weight of the keys on the cuts, over all ranks."""
        return _reduced(self.comm, _tied_weight(self.weights, self.part, self.side, self.parts), MPI.SUM)

    def _cut_along(self, turn: int) -> None:
        """Find each part's cut along its next axis: the weight below fits the target, that up to it does not."""
        rows = np.arange(self.parts)
        axis = np.where(self.filled, self.order[:, turn], -1)
        low = np.where(self.filled, self.lower[rows, axis], 0)
        range_ = np.where(self.filled, self.upper[rows, axis], 0).view(np.uint64) - low.view(np.uint64)
        bits = max(_FEWEST_BITS, min(_MOST_BITS, int(np.log2(_ENTRIES / self.parts))))
        width, below = int(range_.max()).bit_length(), np.zeros(self.parts, np.int64)
        while True:
            width = max(width - bits, 0)
            weight = _histogram(self.keys, self.weights, self.part, self.side, axis, low, width, 1 << bits)
            upto = np.cumsum(_reduced(self.comm, weight, MPI.SUM), axis=1)
            fits = below[:, None] + upto <= self.target[:, None]
            # all the weight fits only in parts without keys, whose cut does not matter
            k = np.minimum(fits.sum(axis=1), (1 << bits) - 1)
            below += np.where(k > 0, upto[rows, k - 1], 0)
            low = (low.view(np.uint64) + (k.astype(np.uint64) << np.uint64(width))).view(np.int64)
            if width == 0:
                break
        _split_tied(self.keys, self.part, self.side, axis, low)
        self.target -= below
        self.cut[self.filled, turn] = low[self.filled]

    def split_cells(self) -> None:
        """Cells on a cut, all the same one, go to the side where the target is met best."""
        left = self.filled & (self.tied() - self.target <= self.target)
        self.cut[left, -1] += 1
        tied = (self.side == _TIED) & (self.part >= 0)
        self.side[tied] = np.where(left[self.part[tied]], _LEFT, _RIGHT)

    def split_points(self) -> None:
        """Points on a cut are told apart by rank and row."""
        tied = _tied_weight(self.weights, self.part, self.side, self.parts)
        before = np.zeros_like(tied)
        self.comm.Exscan(tied, before, MPI.SUM)
        if self.comm.rank == 0:
            before[:] = 0
        _split_by_row(self.weights, self.part, self.side, before, self.target)


def _halves(ranks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rank ranges of the next level that still need cuts, each part's children (-1 - rank when done), in that order."""
    middle = ranks[:, 0] + (ranks[:, 1] - ranks[:, 0]) // 2
    halves = np.stack((ranks[:, 0], middle, middle, ranks[:, 1]), axis=1).reshape(-1, 2, 2)
    several = halves[:, :, 1] - halves[:, :, 0] > 1
    number = np.cumsum(several).reshape(several.shape) - 1
    return halves[several], np.where(several, number, -1 - halves[:, :, 0])


def _cut(
    comm: MPI.Intracomm,
    keys: np.ndarray,
    weights: np.ndarray,
    places: Callable[[np.ndarray], np.ndarray],
    split: Callable[[_Level], None],
) -> tuple[np.ndarray, CutTree]:
    """Owner (n,) int32 of each key, and the cuts; split: what is done with keys on a cut."""
    size, part = comm.size, np.zeros(len(keys), np.int32)
    axes, cuts = np.zeros((2, size - 1, keys.shape[1]), np.int64)
    ranks = np.array([[0, size]] if size > 1 else np.zeros((0, 2)), np.int64)
    if size == 1:
        part[:] = -1
    while len(ranks):
        level = _Level(comm, keys, weights, part, ranks, places)
        split(level)
        middle = ranks[:, 0] + (ranks[:, 1] - ranks[:, 0]) // 2
        axes[middle - 1], cuts[middle - 1] = level.order, level.cut
        ranks, child = _halves(ranks)
        _descend(part, level.side, child)
    return -1 - part, CutTree(axes, cuts, places)


def _integer_weights(comm: MPI.Intracomm, n: int, weights: np.ndarray | None) -> np.ndarray:
    """Weights as integers whose sum over all ranks fits; ones where none are given. Raises ValueError on all ranks."""
    if weights is None:
        return np.ones(n, np.int64)
    weights = np.asarray(weights, dtype=np.float64)
    good = weights.shape == (n,) and bool(np.isfinite(weights).all()) and bool((weights >= 0.0).all())
    total = _reduced(comm, np.array([weights.sum() if good else np.nan, float(n)]), MPI.SUM)
    if np.isnan(total[0]):
        found = f"shape {weights.shape}, from {weights.min(initial=np.inf)} on" if weights.size else "none"
        raise ValueError(f"weights: expected {n} finite numbers, none negative, on every rank; here found {found}")
    if total[0] == 0.0:
        return np.ones(n, np.int64)
    return np.rint(weights * (_UNITS / total[0])).astype(np.int64)


def cut_points(
    comm: MPI.Intracomm, points: np.ndarray, weights: np.ndarray | None = None
) -> tuple[np.ndarray, CutTree]:
    """As `bisect`, with the cuts in between; points on a cut may be on either side."""
    points = checked_points(points)
    if _reduced(comm, np.array([int(np.isnan(bounds(points)[0]).any())]), MPI.MAX)[0]:
        raise ValueError("points: expected finite coordinates, found others on at least one rank")
    weights = _integer_weights(comm, len(points), weights)
    return _cut(comm, keys_of(points), weights, places_of, _Level.split_points)


def bisect(comm: MPI.Intracomm, points: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """New owner of each point, (n,) int32: parts of about equal weight, compact, near ones on near ranks. Collective.

    points (n, d) [m], d = 1, 2 or 3, this rank's share, which may be empty; weights (n,), none negative, or None on all
    ranks. Any number of ranks. Without weights the parts differ by at most two points. The same points give the same
    parts however they are spread over the ranks, save points at one place. Raises ValueError, on all ranks, for weights
    that are negative or not finite and for coordinates that are not finite.
    """
    return cut_points(comm, points, weights)[0]


def cut_cells(comm: MPI.Intracomm, cells: np.ndarray, weights: np.ndarray) -> CutTree:
    """Cuts that give each rank about its share of the weight of cells. Collective.

    cells (n, d) int64: this rank's active cells, which others may list too; weights (n,) int64, none negative.
    """
    cells = np.ascontiguousarray(cells, np.int64)
    return _cut(comm, cells, weights, lambda keys: keys.astype(np.float64), _Level.split_cells)[1]
