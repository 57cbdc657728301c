"""Ghost layers: which points each rank needs of the others, and the exchanges between owners and ghosts."""

import numpy as np
from mpi4py import MPI
from numba import njit

from .cells import bounds, checked_points, within_reach
from .exchange import _TAGS, Exchange
from .swap import swap
from .talking import TALKING

_PLAN_TAG = _TAGS
_KEEP_TAG = _TAGS + 1


def _boxes(comm: MPI.Comm, points: np.ndarray, reach: float) -> np.ndarray:
    """Bounding box of each rank's points (ranks, 2, d); all raise if a coordinate, d or reach of one is wrong."""
    d = points.shape[1]
    mine = np.full(8, np.nan)
    mine[:d], mine[3 : 3 + d] = bounds(points)
    mine[6:] = d, reach if 0.0 < reach < np.inf else np.nan
    boxes = np.empty((comm.size, 8))
    with TALKING:
        comm.Allgather(mine, boxes)
    for rank in range(comm.size):
        if np.isnan(boxes[rank, 7]):
            raise ValueError(f"reach: expected a positive finite length, found another on rank {rank}; here {reach!r}")
        if boxes[rank, 6] != boxes[0, 6] or boxes[rank, 7] != boxes[0, 7]:
            raise ValueError(
                f"points, reach: expected the same dimension and reach on all ranks, found {boxes[rank, 6]:.0f} and "
                f"{boxes[rank, 7]!r} on rank {rank}, {boxes[0, 6]:.0f} and {boxes[0, 7]!r} on rank 0"
            )
        if np.isnan(boxes[rank, :d]).any():
            raise ValueError(f"points: expected finite coordinates, found others on rank {rank}")
    return boxes[:, :6].reshape(comm.size, 2, 3)[:, :, :d]


@njit(cache=True)
def _near_box(points: np.ndarray, lower: np.ndarray, upper: np.ndarray, reach: float) -> np.ndarray:
    """Rows of points closer than reach to a box; rounding is monotonic:, none that close to a point in it is missed."""
    found = 0
    for turn in range(2):
        if turn:
            rows = np.empty(found, np.int64)
            found = 0
        for i in range(len(points)):
            square = 0.0
            for k in range(points.shape[1]):
                gap = max(lower[k] - points[i, k], points[i, k] - upper[k], 0.0)
                square += gap * gap
            if square < reach * reach:
                if turn:
                    rows[found] = i
                found += 1
    return rows


def _overlapping(boxes: np.ndarray, here: int, reach: float) -> list[int]:
    """Other ranks whose boxes are closer than reach to this rank's."""
    lower, upper = boxes[:, 0], boxes[:, 1]
    if not np.all(lower[here] <= upper[here]):
        return []
    gap = np.maximum(np.maximum(lower - upper[here], lower[here] - upper), 0.0)
    near = (gap * gap).sum(axis=1) < reach * reach * (1 + 1e-12)
    near &= (lower <= upper).all(axis=1)
    near[here] = False
    return np.flatnonzero(near).tolist()


class Halo:
    """Which of this rank's points are ghosts elsewhere, and which ghosts it holds. Rows: owned first, ghosts behind.

    comm            the communicator
    owned, ghosts   numbers of rows
    neighbours      ranks that points are sent to or received from, rising
    send_lists      per neighbour: rows (int64, rising) whose ghosts it holds
    receive_counts  per neighbour: how many ghosts it sends; their rows follow one another from `owned` on

    Exchanges must be made, started and finished in the same order on all ranks.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        owned: int,
        ghost_positions: np.ndarray,
        ranks: list[int],
        send_lists: list[np.ndarray],
        receive_counts: list[int],
    ) -> None:
        """Use `Halo.plan`."""
        used = [k for k in range(len(ranks)) if len(send_lists[k]) or receive_counts[k]]
        self.comm = comm
        self.owned = owned
        self.ghosts = len(ghost_positions)
        self.neighbours = [ranks[k] for k in used]
        self.send_lists = [send_lists[k] for k in used]
        self.receive_counts = [int(receive_counts[k]) for k in used]
        self._positions = ghost_positions
        self._made = 0
        send_rows = np.concatenate(self.send_lists) if used else np.empty(0, np.int64)
        self._owner_side = self.neighbours, [len(rows) for rows in self.send_lists], send_rows
        self._ghost_side = self.neighbours, self.receive_counts, np.arange(owned, owned + self.ghosts)

    @classmethod
    def plan(cls, comm: MPI.Comm, points: np.ndarray, reach: float) -> "Halo":
        """Find the ghosts: all points of other ranks closer than `reach` to one of this rank's points, and no others.

        points (n, d) [m], d = 1, 2 or 3, this rank's own, which may be none; reach [m]. Collective. Ghosts are ordered
        by rank and then by row on that rank. Only bounding boxes go to all ranks; points near a rank's box go to that
        rank. Raises ValueError, on all ranks, for a coordinate that is not finite and for a reach that is not positive
        and finite or differs between ranks.
        """
        points = checked_points(points)
        reach = float(reach)
        boxes = _boxes(comm, points, reach)
        ranks = _overlapping(boxes, comm.rank, reach)
        candidates = [_near_box(points, boxes[rank, 0], boxes[rank, 1], reach) for rank in ranks]
        offered = [points[rows] for rows in candidates]
        received = swap(comm, ranks, offered, _PLAN_TAG)
        # both ranks know both sets and the distances have the same bits, so neither needs to tell which it takes
        send_lists = [rows[within_reach(o, r, reach)] for rows, o, r in zip(candidates, offered, received)]
        ghosts = [r[within_reach(r, o, reach)] for o, r in zip(offered, received)]
        positions = np.concatenate([np.empty((0, points.shape[1])), *ghosts])
        return cls(comm, len(points), positions, ranks, send_lists, [len(ghost) for ghost in ghosts])

    def ghost_positions(self) -> np.ndarray:
        """Positions (ghosts, d) [m] that the ghosts had when planned."""
        return self._positions.copy()

    def with_ghosts(self, owned: np.ndarray) -> np.ndarray:
        """A new array of the owned rows (owned, ...) followed by the ghosts', of a type of 8 bytes; collective."""
        full = np.empty((self.owned + self.ghosts, *owned.shape[1:]), owned.dtype)
        full[: self.owned] = owned
        self.update([full])
        return full

    def ghost_ranks(self) -> np.ndarray:
        """Owner of each ghost (ghosts,) int32."""
        return np.repeat(np.array(self.neighbours, np.int32), self.receive_counts)

    def keep(self, mask: np.ndarray, owned: np.ndarray | None = None) -> "Halo":
        """A halo of only those ghosts for which mask (ghosts,) is true, in the same order; collective.

        owned (owned,): which of the own rows stay, all unless given; every ghost that any rank keeps must be one.
        """
        mask = np.asarray(mask, dtype=bool)
        if mask.shape != (self.ghosts,):
            raise ValueError(f"mask: expected shape ({self.ghosts},), one entry a ghost, found {mask.shape}")
        ends = np.cumsum(self.receive_counts, dtype=np.int64)
        pieces = [mask[end - count : end].copy() for end, count in zip(ends, self.receive_counts)]
        wanted = swap(self.comm, self.neighbours, pieces, _KEEP_TAG)
        send_lists = [rows[theirs] for rows, theirs in zip(self.send_lists, wanted)]
        counts = [int(piece.sum()) for piece in pieces]
        if owned is not None:
            number = np.cumsum(owned) - 1
            if not all(owned[rows].all() for rows in send_lists):
                raise ValueError("owned: expected every row that a rank keeps as a ghost, found some left out")
            send_lists = [number[rows] for rows in send_lists]
        count = self.owned if owned is None else int(np.sum(owned))
        return Halo(self.comm, count, self._positions[mask], self.neighbours, send_lists, counts)

    def _tag(self) -> int:
        self._made += 1
        return self._made % _TAGS

    def exchange(self, arrays: list[np.ndarray]) -> Exchange:
        """An exchange that copies owners' rows of the arrays to their ghosts; make it in the same order on all ranks.

        arrays: (capacity, ...) of any strides and any type of 8 bytes, capacity >= owned + ghosts; the same columns on
        all ranks. All travel in one message a neighbour. Raises ValueError for other arrays.
        """
        return Exchange(
            self.comm, arrays, self._owner_side, self._ghost_side, self.owned + self.ghosts, self._tag(), False
        )

    def accumulate(self, arrays: list[np.ndarray]) -> Exchange:
        """An exchange that adds ghosts' rows of float64 arrays to their owners', in the order of the holding ranks.

        The ghosts' rows keep their values. Otherwise as `exchange`.
        """
        return Exchange(
            self.comm, arrays, self._ghost_side, self._owner_side, self.owned + self.ghosts, self._tag(), True
        )

    def update(self, arrays: list[np.ndarray]) -> None:
        """Copy owners' rows to their ghosts now, once; for set-up. Collective."""
        exchange = self.exchange(arrays)
        exchange.start()
        exchange.finish()
        exchange.free()
