"""Nodes on which two background grids with one lattice meet, and sums and extremes over all ranks that have any.

The grids have partitions of their own, so a node's two sides may be on ranks that share neither grid's nodes.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from .grid import RankGrid
from .node_sum import NodeSum, Sharing, _Messages
from .occupied import words
from .swap import swap

_OFFER_TAG, _SUM_TAG = 31, 32


class SharedNodes:
    """Nodes (count,) by their `words`, sorted, that a rank has of one of two grids and any rank of the other.

    version counts their changes. Every call talks to ranks near by, and to no others.
    """

    def __init__(self, comm: MPI.Comm, grids: tuple[RankGrid, RankGrid]) -> None:
        self.comm, self.grids = comm, grids
        self.words, self.version = np.zeros(0, np.int64), 0
        self.sharing = Sharing([], [])
        self._partitions: list[Any] = []
        self._seen: list[tuple[int, int]] = []

    def follow(self) -> bool:
        """Take over the grids' present nodes; whether anything has changed here. On all ranks, after grids settle."""
        partitions = [grid.partition for grid in self.grids]
        if len(self._partitions) != 2 or any(one is not two for one, two in zip(partitions, self._partitions)):
            self._partitions, self._seen = partitions, []
            self.neighbours = self._near()
            nothing = np.zeros(0, np.int64)
            self._theirs = [(nothing, nothing) for _ in self.neighbours]
        seen = [grid.version for grid in self.grids]
        changed = seen != self._seen
        self._seen = seen
        if changed:
            self._mine = [words(grid.cells.nodes) for grid in self.grids]
            self._offers = self._found_offers()
        nothing = np.zeros(0, np.int64)
        told = [np.concatenate(([len(one)], one, two)) if changed else nothing for one, two in self._offers]
        for number, message in enumerate(swap(self.comm, self.neighbours, told, _OFFER_TAG)):
            if len(message):
                self._theirs[number] = message[1 : message[0] + 1].copy(), message[message[0] + 1 :].copy()
                changed = True
        if changed:
            self._share()
        return changed

    def _near(self) -> list[int]:
        """Ranks, rising, whose part of any grid may come within a stencil of this rank's part of any; mutual."""
        reach = max(grid.cells.width + 2 * grid.slack for grid in self.grids)
        boxes = np.stack([one.boxes() if one.ranks > 1 else _everywhere(self.grids[0]) for one in self._partitions])
        mine = boxes[:, self.comm.rank]
        gap = np.maximum(
            boxes[None, :, :, 0] - mine[:, None, None, 1], mine[:, None, None, 0] - boxes[None, :, :, 1]
        ).max(axis=-1)
        near = (gap <= reach).any(axis=(0, 1))
        near[self.comm.rank] = False
        found: list[int] = np.flatnonzero(near).tolist()
        return found

    def _found_offers(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """This rank's nodes of both grids that concern each neighbour, as it may have either there."""
        pairs = []
        for grid in self.grids:
            slack, nodes = grid.slack, grid.cells.nodes
            found = [
                one.touching(nodes + slack, grid.cells.width + 2 * slack, self.comm.rank) for one in self._partitions
            ]
            pairs.append(np.concatenate(found))
        return [
            (self._mine[0][_rows(pairs[0], rank)], self._mine[1][_rows(pairs[1], rank)]) for rank in self.neighbours
        ]

    def _share(self) -> None:
        there = [np.concatenate([self._mine[k], *(one[k] for one in self._theirs)]) for k in (0, 1)]
        here = np.union1d(self._mine[0], self._mine[1])
        self.words = np.intersect1d(np.intersect1d(there[0], there[1]), here)
        shared = []
        for offered, theirs in zip(self._offers, self._theirs):
            common = np.intersect1d(np.union1d(offered[0], offered[1]), np.union1d(theirs[0], theirs[1]))
            common = np.intersect1d(common, self.words)
            shared.append(np.searchsorted(self.words, common).astype(np.int32))
        self.version += 1
        self.sharing = Sharing(self.neighbours, shared, self.version)

    def sum(self, array: np.ndarray, tag: int) -> NodeSum:
        """Adds up the rows of an array (count, c) over the ranks, for the present version."""
        return NodeSum(self.comm, self.sharing, array, (0, array.shape[1]), _SUM_TAG + tag)

    def largest(self, array: np.ndarray, tag: int) -> "NodeMaximum":
        """Finds the largest of each number of an array (count, c) over the ranks, for the present version."""
        return NodeMaximum(self.comm, self.sharing, array, _SUM_TAG + tag)


class NodeMaximum:
    """Largest numbers of nodes over the ranks that have them."""

    def __init__(self, comm: MPI.Comm, sharing: Sharing, array: np.ndarray, tag: int) -> None:
        self._array, self._slots = array, np.concatenate([np.zeros(0, np.int32), *sharing.shared])
        sizes = [array.shape[1] * len(slots) for slots in sharing.shared]
        self._messages = _Messages(comm, sharing.neighbours, tag, sizes, sizes)

    def find(self) -> None:
        """Exchange with the others."""
        if len(self._slots):
            self._messages.receive()
            self._messages.outgoing[:] = self._array[self._slots].ravel()
            self._messages.send()
            self._messages.wait()
            np.maximum.at(self._array, self._slots, self._messages.incoming.reshape(len(self._slots), -1))


def _rows(pairs: np.ndarray, rank: int) -> np.ndarray:
    return np.asarray(np.unique(pairs[pairs[:, 1] == rank, 0]))


def _everywhere(grid: RankGrid) -> np.ndarray:
    """The box of the only rank."""
    far = np.full(grid.dimension, np.int64(1) << 40)
    return np.stack((-far, far))[None]
