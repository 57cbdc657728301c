"""Nodes on which two background grids with one lattice meet, and sums and extremes over all ranks that have any.

The grids have partitions of their own, so a node's two sides may be on ranks that share neither grid's nodes.
"""

import numpy as np
from mpi4py import MPI

from .bisection import CutTree
from .grid import NeighbourArrays, RankGrid, rows_of_ranks
from .plan import Plan


class SharedNodes:
    """Nodes (count,) by their `words`, sorted, that a rank has of one of two grids and any rank of the other.

    plan: their numbers that this rank shares with others, for the present nodes only.
    """

    def __init__(self, comm: MPI.Comm, grids: tuple[RankGrid, RankGrid]) -> None:
        self.comm, self.grids, self.words = comm, grids, np.zeros(0, np.int64)
        self.plan = Plan(comm, [], [], [])
        self._partitions: list[CutTree] = []
        self._seen: list[tuple[int, int]] = []

    def follow(self) -> bool:
        """Take over the grids' present nodes; whether anything has changed here. On all ranks, after grids have updated
        their cells; talks to ranks near by, and to no others."""
        partitions = [grid.partition for grid in self.grids]
        if len(self._partitions) != 2 or any(one is not two for one, two in zip(partitions, self._partitions)):
            self._partitions, self._seen = partitions, []
            self._told = NeighbourArrays(self.comm, self._near())
        seen = [grid.version for grid in self.grids]
        changed, self._seen = seen != self._seen, seen
        if not self._told.update(self._candidates() if changed else None):
            return False
        mine, theirs = ([_of_both_grids(one) for one in told] for told in (self._told.mine, self._told.theirs))
        there = [np.concatenate([self._mine[k], *(one[k] for one in theirs)]) for k in (0, 1)]
        here = np.union1d(*self._mine)
        self.words = np.intersect1d(np.intersect1d(there[0], there[1]), here)
        shared = []
        for own, others in zip(mine, theirs):
            common = np.intersect1d(np.intersect1d(np.union1d(*own), np.union1d(*others)), self.words)
            shared.append(np.searchsorted(self.words, common))
        self.plan = Plan(self.comm, self._told.neighbours, shared, shared)
        return True

    def _near(self) -> list[int]:
        """Ranks, rising, whose part of any grid may come within a stencil of this rank's part of any; mutual."""
        reach, here = max(grid.cells.width + 2 * grid.slack for grid in self.grids), self.comm.rank
        boxes = [one.box(here) for one in self._partitions]
        return sorted({rank for one in self._partitions for box in boxes for rank in one.near(box, reach)} - {here})

    def _candidates(self) -> list[np.ndarray]:
        """This rank's nodes that concern each neighbour, as it may have them of either grid: how many of the first
        grid, their words, and those of the second."""
        self._mine, words = [grid.cells.node_words for grid in self.grids], []
        for grid, mine in zip(self.grids, self._mine):
            where = grid.cells.nodes + grid.slack, grid.cells.width + 2 * grid.slack, self.comm.rank
            pairs = np.concatenate([one.touching(*where) for one in self._partitions])
            words.append([mine[rows] for rows in rows_of_ranks(pairs, self._told.neighbours)])
        return [np.concatenate(([len(one)], one, two)) for one, two in zip(*words)]


def _of_both_grids(told: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Words of the first and of the second grid in what `_candidates` gives."""
    count = told[0] if len(told) else 0
    return told[1 : count + 1], told[count + 1 :]
