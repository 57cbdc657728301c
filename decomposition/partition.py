"""Weighted recursive coordinate bisection in parallel; no rank ever holds all points.

Source: M. J. Berger and S. H. Bokhari, "A partitioning strategy for nonuniform problems on multiprocessors", IEEE
Transactions on Computers C-36 (1987). All parts of a level are cut at once. A cut is found exactly, by histograms over
the bits of the coordinates; points tied on the cut are told apart by their other coordinates, and points at one place
by rank and row, so that lattices, too, are cut to the particle.
"""

import numpy as np
from mpi4py import MPI
from numba import njit

from .cells import bounds, checked_points
from .talking import TALKING

# histogram entries of a level, shared by its parts, and the most and fewest bins of a part
_ENTRIES, _MOST_BITS, _FEWEST_BITS = 1 << 16, 8, 2
# total weight in integer units: exact sums in any order, and room for rounding up
_UNITS = 2.0**61
# all shares of ranks in integer units
_SHARES = 2.0**20
_TIED, _LEFT, _RIGHT = np.int8(0), np.int8(1), np.int8(2)


@njit(cache=True)
def _sortable(bits: np.uint64) -> np.uint64:
    """Unsigned integer in the order of the double that has these bits; the zeros of both signs are one."""
    sign = np.uint64(1) << np.uint64(63)
    if bits == sign:
        return sign
    return ~bits if bits & sign else bits | sign


@njit(cache=True)
def _part_bounds(points: np.ndarray, part: np.ndarray, parts: int) -> np.ndarray:
    """Lower and negated upper corner of each part's points: (parts, 2, d)."""
    result = np.full((parts, 2, points.shape[1]), np.inf)
    for i in range(len(points)):
        p = part[i]
        if p >= 0:
            for k in range(points.shape[1]):
                result[p, 0, k] = min(result[p, 0, k], points[i, k])
                result[p, 1, k] = min(result[p, 1, k], -points[i, k])
    return result


@njit(cache=True)
def _histogram(
    bits: np.ndarray,
    weights: np.ndarray,
    part: np.ndarray,
    side: np.ndarray,
    axis: np.ndarray,
    low: np.ndarray,
    shift: np.ndarray,
    bins: int,
) -> np.ndarray:
    """Weight of the tied points of each part in each bin of width 2**shift from `low`.

    bits (n, d) uint64: those of the coordinates; points beyond the bins at either end are left out.
    """
    result = np.zeros((len(axis), bins), np.int64)
    for i in range(len(bits)):
        p = part[i]
        if p < 0 or side[i] != _TIED or axis[p] < 0:
            continue
        key = _sortable(bits[i, axis[p]])
        if key >= low[p]:
            k = (key - low[p]) >> shift[p]
            if k < np.uint64(bins):
                result[p, np.int64(k)] += weights[i]
    return result


@njit(cache=True)
def _split_tied(bits: np.ndarray, part: np.ndarray, side: np.ndarray, axis: np.ndarray, cut: np.ndarray) -> None:
    """Send tied points beside the cut to their side; those on it stay tied."""
    for i in range(len(bits)):
        p = part[i]
        if p >= 0 and side[i] == _TIED and axis[p] >= 0:
            key = _sortable(bits[i, axis[p]])
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
    before = before.copy()
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
            part[i] = child[part[i], side[i] - 1]


def _reduced(comm: MPI.Intracomm, local: np.ndarray, operation: MPI.Op) -> np.ndarray:
    with TALKING:
        comm.Allreduce(MPI.IN_PLACE, local, operation)
    return local


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


class _Level:
    """The cut of all parts of one level; every array has one row a part."""

    def __init__(
        self,
        comm: MPI.Intracomm,
        points: np.ndarray,
        weights: np.ndarray,
        part: np.ndarray,
        ranks: np.ndarray,
        upto: np.ndarray,
    ) -> None:
        """upto (ranks + 1,): sums of the shares of all ranks before each, integers."""
        self.comm, self.points, self.weights, self.part, self.ranks = comm, points, weights, part, ranks
        self.parts = len(ranks)
        self.bits = points.view(np.uint64)
        self.side = np.zeros(len(points), np.int8)
        box = _reduced(comm, _part_bounds(points, part, self.parts), MPI.MIN)
        self.lower, self.upper = box[:, 0], -box[:, 1]
        total = self._tied()
        self.filled = total > 0
        middle = ranks[:, 0] + (ranks[:, 1] - ranks[:, 0]) // 2
        whole, share = np.maximum(upto[ranks[:, 1]] - upto[ranks[:, 0]], 1), upto[middle] - upto[ranks[:, 0]]
        # total * share // whole without overflow
        self.target = total // whole * share + total % whole * share // whole

    def _tied(self) -> np.ndarray:
        return _reduced(self.comm, _tied_weight(self.weights, self.part, self.side, self.parts), MPI.SUM)

    def cut(self) -> np.ndarray:
        """Side of every point: 1 left, 2 right."""
        extent = np.where(self.filled[:, None], self.upper - self.lower, 0.0)
        longest_first = np.argsort(-extent, axis=1, kind="stable")
        for turn in range(self.points.shape[1]):
            axis = np.where(self.filled, longest_first[:, turn], -1)
            self._cut_along(axis)
        tied = _tied_weight(self.weights, self.part, self.side, self.parts)
        before = np.zeros_like(tied)
        self.comm.Exscan(tied, before, MPI.SUM)
        if self.comm.rank == 0:
            before[:] = 0
        _split_by_row(self.weights, self.part, self.side, before, self.target)
        return self.side

    def _cut_along(self, axis: np.ndarray) -> None:
        """Find each part's cut value along its axis: the weight below fits the target, that up to it does not."""
        rows = np.arange(self.parts)
        low, high = np.zeros(self.parts, np.uint64), np.zeros(self.parts, np.uint64)
        lower, upper = self.lower.copy().view(np.uint64), self.upper.copy().view(np.uint64)
        for p in np.flatnonzero(axis >= 0):
            low[p], high[p] = _sortable(lower[p, axis[p]]), _sortable(upper[p, axis[p]])
        bits = max(_FEWEST_BITS, min(_MOST_BITS, int(np.log2(_ENTRIES / self.parts))))
        width = int(max((int(above) - int(under) for under, above in zip(low, high)), default=0)).bit_length()
        below = np.zeros(self.parts, np.int64)
        while True:
            width = max(width - bits, 0)
            shift = np.full(self.parts, width, np.uint64)
            weight = _histogram(self.bits, self.weights, self.part, self.side, axis, low, shift, 1 << bits)
            upto = np.cumsum(_reduced(self.comm, weight, MPI.SUM), axis=1)
            fits = below[:, None] + upto <= self.target[:, None]
            # all the weight fits only in parts without points, whose cut does not matter
            k = np.minimum(fits.sum(axis=1), (1 << bits) - 1)
            below += np.where(k > 0, upto[rows, k - 1], 0)
            low += k.astype(np.uint64) << shift
            if width == 0:
                break
        _split_tied(self.bits, self.part, self.side, axis, low)
        self.target -= below


def _halves(ranks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rank ranges of the next level that still need cuts, each part's children (-1 - rank when done), in that order."""
    child = np.empty((len(ranks), 2), np.int32)
    following: list[tuple[int, int]] = []
    for p, (first, last) in enumerate(ranks):
        middle = first + (last - first) // 2
        for side, (lower, upper) in enumerate(((first, middle), (middle, last))):
            if upper - lower == 1:
                child[p, side] = -1 - lower
            else:
                child[p, side] = len(following)
                following.append((lower, upper))
    return np.array(following, np.int64).reshape(-1, 2), child


def bisect(
    comm: MPI.Intracomm, points: np.ndarray, weights: np.ndarray | None = None, shares: np.ndarray | None = None
) -> np.ndarray:
    """New owner of each point, (n,) int32: parts of about equal weight, compact, near ones on near ranks. Collective.

    points (n, d) [m], d = 1, 2 or 3, this rank's share, which may be empty; weights (n,), none negative, or None on all
    ranks; shares (ranks,), the same on all: what ranks shall have of the weight, in any unit, equal ones unless given.
    Any number of ranks. Without either the parts differ by at most two points. The same points give the same parts
    however they are spread over the ranks, save points at one place. Raises ValueError, on all ranks, for weights that
    are negative or not finite and for coordinates that are not finite.
    """
    points = checked_points(points)
    if _reduced(comm, np.array([int(np.isnan(bounds(points)[0]).any())]), MPI.MAX)[0]:
        raise ValueError("points: expected finite coordinates, found others on at least one rank")
    weights = _integer_weights(comm, len(points), weights)
    if comm.size == 1:
        return np.zeros(len(points), np.int32)
    part = np.zeros(len(points), np.int32)
    ranks, upto = np.array([[0, comm.size]], np.int64), np.arange(comm.size + 1)
    if shares is not None:
        upto[1:] = np.cumsum(np.rint(np.asarray(shares) * (_SHARES / np.sum(shares))))
    while len(ranks):
        side = _Level(comm, points, weights, part, ranks, upto).cut()
        ranks, child = _halves(ranks)
        _descend(part, side, child)
    return -1 - part
