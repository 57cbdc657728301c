"""Ghost layers: which points each rank needs of the others, and the exchanges between owners and ghosts."""

import numpy as np
from mpi4py import MPI
from numba import njit

from .pair_search import bounds, checked_points, within_reach
from .plan import Exchange, Plan, send_to_some, swap
from .timer import COMMUNICATION

# ranks up to which all know the boxes of all: a table of 6 kB, faster than asking a directory
_FEW = 64
# by which ghosts should reach farther than pairs whose distances are rounded in another way
REACH_MARGIN = 1.0 + 1e-9


@njit(cache=True)
def _near_box(points: np.ndarray, lower: np.ndarray, upper: np.ndarray, reach: float) -> np.ndarray:
    """Rows of points closer than reach to a box; rounding is monotonic: none that close to a point in it is missed."""
    rows, found = np.empty(len(points), np.int64), 0
    for i in range(len(points)):
        square = 0.0
        for k in range(points.shape[1]):
            gap = max(lower[k] - points[i, k], points[i, k] - upper[k], 0.0)
            square += gap * gap
        if square < reach * reach:
            rows[found] = i
            found += 1
    return rows[:found].copy()


# --- ranks that are near ------------------------------------------------------------------------------------------


def _summary(points: np.ndarray, reach: float) -> np.ndarray:
    """Twelve numbers of a rank whose maxima over all ranks are used: whether a coordinate is not finite, whether the
    reach is bad, d, -d, reach, -reach, and the upper corners of its box and of the box of the negated points."""
    d, good = points.shape[1], 0.0 < reach < np.inf
    lower, upper = bounds(points)
    wrong, result = bool(np.isnan(lower).any()), np.full(12, -np.inf)
    result[:6] = wrong, not good, d, -d, reach if good else 0.0, -reach if good else 0.0
    result[6 : 6 + d], result[9 : 9 + d] = (0.0, 0.0) if wrong else (upper, -lower)
    return result


def _check(most: np.ndarray, reach: float) -> None:
    """Raise ValueError for faults in the maxima (12,) of all ranks' summaries."""
    if most[1]:
        raise ValueError(f"reach: expected a positive finite length, found another on a rank; here {reach!r}")
    if most[2] != -most[3] or most[4] != -most[5]:
        raise ValueError(
            f"points, reach: expected the same dimension and reach on all ranks, found {-most[3]:.0f} to {most[2]:.0f} "
            f"and {-most[5]!r} to {most[4]!r}"
        )
    if most[0]:
        raise ValueError("points: expected finite coordinates, found others on a rank")


def _boxes(summaries: np.ndarray, d: int) -> np.ndarray:
    """Boxes (..., 2, d) of summaries (..., 12), lower corners first; infinite ones of ranks without points."""
    return np.stack((-summaries[..., 9 : 9 + d], summaries[..., 6 : 6 + d]), axis=-2)


def _overlap(boxes: np.ndarray, box: np.ndarray, reach: float) -> np.ndarray:
    """Which boxes (n, 2, d) are closer than reach to another (2, d); those of ranks without points are not."""
    gap = np.maximum(np.maximum(boxes[:, 0] - box[1], box[0] - boxes[:, 1]), 0.0)
    return np.asarray((gap * gap).sum(axis=1) < reach * reach * (1 + 1e-12))


def near_ranks(comm: MPI.Comm, points: np.ndarray, reach: float) -> tuple[list[int], np.ndarray]:
    """Other ranks, rising, whose boxes of points are closer than reach to this rank's, and their boxes (n, 2, d).

    Collective. All raise ValueError if a coordinate, d or reach of one is wrong.
    """
    mine, d = _summary(points, reach), points.shape[1]
    box = _boxes(mine, d)
    if comm.size > _FEW:
        most = np.empty_like(mine)
        with COMMUNICATION:
            comm.Allreduce(mine, most, MPI.MAX)
        _check(most, reach)
        # nothing grows with the number of ranks: each rank tells its box to those that keep the parts of space that it
        # overlaps, and these make ranks known to each other
        cells = directory_cells(box, _boxes(most, d), reach, comm.size)
        keepers = np.unique(cells % comm.size)
        entry = np.concatenate(([0.0, comm.rank], box.ravel()))
        sent = [np.tile(entry, (int((cells % comm.size == keeper).sum()), 1)) for keeper in keepers]
        for keeper, entries in zip(keepers, sent):
            entries[:, 0] = cells[cells % comm.size == keeper]
        entries = _with_own(comm, keepers.tolist(), sent, entry)
        pairs = introductions(entries, reach)
        guests = np.unique(pairs[:, 0])
        answers = [entries[pairs[pairs[:, 0] == guest, 1].astype(np.int64), 1:] for guest in guests]
        found = _with_own(comm, guests.astype(np.int64).tolist(), answers, entry[1:])
        ranks, first = np.unique(found[:, 0], return_index=True)
        return ranks.astype(np.int64).tolist(), found[first, 1:].reshape(-1, *box.shape)
    table = np.empty((comm.size, len(mine)))
    with COMMUNICATION:
        comm.Allgather(mine, table)
    _check(table.max(axis=0), reach)
    boxes = _boxes(table, d)
    near = _overlap(boxes, box, reach) if len(points) else np.zeros(comm.size, bool)
    near[comm.rank] = False
    return np.flatnonzero(near).tolist(), boxes[near]


def _with_own(comm: MPI.Comm, ranks: list[int], arrays: list[np.ndarray], like: np.ndarray) -> np.ndarray:
    """Send arrays (n, k) to ranks, this one included; returns the rows that this rank gets. like: one row."""
    own = [array for rank, array in zip(ranks, arrays) if rank == comm.rank]
    others = [(rank, array) for rank, array in zip(ranks, arrays) if rank != comm.rank]
    _, come = send_to_some(comm, [one[0] for one in others], [one[1] for one in others], like[None])
    return np.concatenate([np.empty((0, len(like))), *own, *come])


def directory_cells(box: np.ndarray, everything: np.ndarray, reach: float, ranks: int) -> np.ndarray:
    """Cells of a directory that a box (2, d) widened by half a reach overlaps; about as many in all as ranks, and rank
    `cell % ranks` keeps a cell. So two boxes closer than reach have a cell in common."""
    if not box[0, 0] <= box[1, 0]:
        return np.zeros(0, np.int64)
    extent = everything[1] - everything[0] + 2.0 * reach
    edge = (np.prod(extent / extent.max()) / ranks) ** (1.0 / len(extent)) * extent.max()
    shape = np.maximum(1, np.floor(extent / max(edge, reach))).astype(np.int64)
    scale, hair = shape / extent, 0.5 * reach * (1.0 + 1e-6) + 1e-12 * np.abs(everything).max()
    first = np.clip(np.floor((box[0] - hair - everything[0] + reach) * scale), 0, shape - 1).astype(np.int64)
    last = np.clip(np.floor((box[1] + hair - everything[0] + reach) * scale), 0, shape - 1).astype(np.int64)
    axes = np.meshgrid(*[np.arange(a, b + 1) for a, b in zip(first, last)], indexing="ij")
    return np.asarray(np.ravel_multi_index([axis.ravel() for axis in axes], shape.tolist()))


def introductions(entries: np.ndarray, reach: float) -> np.ndarray:
    """Pairs (rank, row of the entry of another rank whose box is near) that the keeper of a directory sends out.

    entries (n, 2 + 2 d): cell, rank and box.
    """
    pairs = [np.empty((0, 2))]
    boxes = entries[:, 2:].reshape(len(entries), 2, (entries.shape[1] - 2) // 2)
    for cell in np.unique(entries[:, 0]):
        here = np.flatnonzero(entries[:, 0] == cell)
        for row in here:
            near = here[_overlap(boxes[here], boxes[row], reach)]
            near = near[near != row]
            pairs.append(np.column_stack((np.full(len(near), entries[row, 1]), near)))
    return np.concatenate(pairs)


# --- ghosts -------------------------------------------------------------------------------------------------------


class Halo:
    """Which of this rank's points are ghosts elsewhere, and which ghosts it holds. Rows: owned first, ghosts behind.

    comm            the communicator
    owned, ghosts   numbers of rows
    plan            neighbours, the rows that each has as ghosts, rising, and the rows of the ghosts that each sends,
                    one neighbour after the other

    Exchanges must be started and finished in the same order on all ranks.
    """

    def __init__(self, comm: MPI.Comm, points: np.ndarray, reach: float) -> None:
        """Find the ghosts: all points of other ranks closer than `reach` to one of this rank's points, and no others.

        points (n, d) [m], d = 1, 2 or 3, this rank's own, which may be none; reach [m]. Collective. Ghosts are ordered
        by rank and then by row on that rank. Points near a rank's bounding box go to that rank. Raises ValueError, on
        all ranks, for a coordinate that is not finite and for a reach that is not positive and finite or differs
        between ranks.
        """
        points, reach = checked_points(points), float(reach)
        ranks, boxes = near_ranks(comm, points, reach)
        candidates = [_near_box(points, *box, reach) for box in boxes]
        offered = [points[rows] for rows in candidates]
        received = swap(comm, ranks, offered)
        # both ranks know both sets and the distances have the same bits, so neither needs to tell which it takes
        send_rows = [rows[within_reach(o, r, reach)] for rows, o, r in zip(candidates, offered, received)]
        ghosts = [r[within_reach(r, o, reach)] for o, r in zip(offered, received)]
        self._set(comm, len(points), ranks, send_rows, [len(g) for g in ghosts])

    def _set(
        self, comm: MPI.Comm, owned: int, ranks: list[int], send_rows: list[np.ndarray], counts: list[int]
    ) -> None:
        """counts: ghosts of each rank."""
        self.comm, self.owned, self.ghosts = comm, owned, sum(counts)
        ends = owned + np.cumsum(counts, dtype=np.int64)
        receive_rows = [np.arange(end - count, end) for end, count in zip(ends, counts)]
        self.plan = Plan(comm, ranks, send_rows, receive_rows, owned + self.ghosts)

    def with_ghosts(self, owned: np.ndarray) -> np.ndarray:
        """A new array of the owned rows (owned, ...) followed by the ghosts', of a type of 8 bytes; collective."""
        full = np.empty((self.owned + self.ghosts, *owned.shape[1:]), owned.dtype)
        full[: self.owned] = owned
        exchange = self.forward(full)
        exchange.now()
        exchange.free()
        return full

    def subset(self, ghosts: np.ndarray, owned: np.ndarray | None = None) -> "Halo":
        """A halo of only those ghosts for which a mask (ghosts,) is true, in the same order; collective.

        owned (owned,): which of the own rows stay, all unless given; every ghost that any rank keeps must be one.
        """
        ghosts, plan = np.asarray(ghosts, dtype=bool), self.plan
        if ghosts.shape != (self.ghosts,):
            raise ValueError(f"ghosts: expected shape ({self.ghosts},), one entry a ghost, found {ghosts.shape}")
        pieces = [ghosts[rows - self.owned] for rows in plan.receive_rows]
        wanted = swap(self.comm, plan.neighbours, pieces)
        send_rows = [rows[theirs] for rows, theirs in zip(plan.send_rows, wanted)]
        count = self.owned
        if owned is not None:
            number, count = np.cumsum(owned) - 1, int(np.sum(owned))
            if not all(owned[rows].all() for rows in send_rows):
                raise ValueError("owned: expected every row that a rank keeps as a ghost, found some left out")
            send_rows = [number[rows] for rows in send_rows]
        result = Halo.__new__(Halo)
        result._set(self.comm, count, plan.neighbours, send_rows, [int(piece.sum()) for piece in pieces])
        return result

    def forward(self, *arrays: np.ndarray) -> Exchange:
        """An exchange that copies owners' rows of the arrays to their ghosts, see `Plan`; they have room for all
        rows."""
        return self.plan.forward(*arrays)

    def reverse(self, *arrays: np.ndarray) -> Exchange:
        """An exchange that adds ghosts' rows of float64 arrays to their owners', in the order of the holding ranks; the
        ghosts' rows keep their values."""
        return self.plan.reverse(*arrays)
