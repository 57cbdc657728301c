"""Which rank owns which cell of an unbounded lattice: recursive cuts, exact to one cell, known to every rank.

A cut sends a cell left when its index, read as a word with the cut's axis first, comes before the cut's: a plane with
one step in it, so that parts can be as equal as whole cells allow. Source of the bisection: see `partition`.
"""

from typing import Any

import numpy as np
from mpi4py import MPI
from numba import njit

from decomposition.talking import TALKING

# bounds of parts that reach to infinity
_FAR = np.int64(1) << 40

# first rank, the one after the last, and where the number of this cut goes: row and side of the children
_Range = tuple[int, int, tuple[int, int] | None]


@njit(cache=True)
def _before(cell: np.ndarray, axes: np.ndarray, cut: np.ndarray) -> bool:
    """Whether a cell's index comes before the cut's, axis by axis."""
    for k in range(len(cut)):
        if cell[axes[k]] != cut[k]:
            return cell[axes[k]] < cut[k]
    return False


@njit(cache=True)
def owners_of(axes: np.ndarray, cuts: np.ndarray, children: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Owner of each cell; children < 0 stand for rank -1 - child."""
    result = np.zeros(len(cells), np.int32)
    if len(cuts) == 0:
        return result
    for n in range(len(cells)):
        at = 0
        while at >= 0:
            at = children[at, 0] if _before(cells[n], axes[at], cuts[at]) else children[at, 1]
        result[n] = -1 - at
    return result


@njit(cache=True)
def _touching(
    axes: np.ndarray, cuts: np.ndarray, children: np.ndarray, nodes: np.ndarray, width: int, here: int
) -> np.ndarray:
    """Pairs (row of a node, other rank) for ranks that may own one of the cells node - width + 1 .. node."""
    found = np.empty((64, 2), np.int64)
    count, stack, d = 0, np.empty(128, np.int64), nodes.shape[1]
    lowest = np.empty(d, np.int64)
    for n in range(len(nodes)):
        for k in range(d):
            lowest[k] = nodes[n, k] - width + 1
        depth, stack[0] = 1, 0
        while depth:
            depth -= 1
            at = stack[depth]
            if at < 0:
                if -1 - at != here:
                    if count == len(found):
                        found = np.concatenate((found, found))
                    found[count, 0], found[count, 1] = n, -1 - at
                    count += 1
                continue
            # a box of cells has its first and its last word at its corners
            if _before(lowest, axes[at], cuts[at]):
                stack[depth] = children[at, 0]
                depth += 1
            if not _before(nodes[n], axes[at], cuts[at]):
                stack[depth] = children[at, 1]
                depth += 1
    return found[:count]


class CellPartition:
    """Owners of all cells of a lattice of dimension d, the same on every rank.

    axes (parts - 1, d): order in which a cut compares a cell's indices; cuts (parts - 1, d): the first word on the
    right, in that order; children (parts - 1, 2): the next cut, or -1 - rank. Part 0 is the root.
    """

    def __init__(self, axes: np.ndarray, cuts: np.ndarray, children: np.ndarray) -> None:
        self.axes = np.asarray(axes, np.int64)
        self.cuts = np.asarray(cuts, np.int64)
        self.children = np.asarray(children, np.int64)
        self.ranks = len(self.cuts) + 1

    @classmethod
    def whole(cls, dimension: int) -> "CellPartition":
        """All cells to rank 0."""
        return cls(np.zeros((0, dimension)), np.zeros((0, dimension)), np.zeros((0, 2)))

    def state(self) -> dict[str, Any]:
        """As plain lists, for a file."""
        return {"axes": self.axes.tolist(), "cuts": self.cuts.tolist(), "children": self.children.tolist()}

    @classmethod
    def from_state(cls, state: dict[str, Any], dimension: int) -> "CellPartition":
        """The partition of a `state`."""
        shapes = {"axes": (-1, dimension), "cuts": (-1, dimension), "children": (-1, 2)}
        return cls(**{name: np.array(state[name], np.int64).reshape(shape) for name, shape in shapes.items()})

    def owners(self, cells: np.ndarray) -> np.ndarray:
        """Owner (n,) int32 of cells (n, d) int64."""
        return owners_of(self.axes, self.cuts, self.children, cells)

    def touching(self, nodes: np.ndarray, width: int, here: int) -> np.ndarray:
        """Which other ranks may have cells whose stencil of `width` nodes a direction holds a node; a cell's stencil
        begins at the node of its own index. nodes (n, d); returns (m, 2): row of the node, rank; all true pairs and few
        others.
        """
        if len(self.cuts) == 0:
            return np.zeros((0, 2), np.int64)
        return _touching(self.axes, self.cuts, self.children, nodes, width, here)

    def boxes(self) -> np.ndarray:
        """Least boxes (ranks, 2, d) of lowest and highest cells around the ranks' parts; far away where unbounded."""
        d = self.cuts.shape[1]
        result = np.empty((self.ranks, 2, d), np.int64)
        result[:, 0], result[:, 1] = -_FAR, _FAR
        stack = [(0 if len(self.cuts) else -1, result[0].copy())]
        while stack:
            at, box = stack.pop()
            if at < 0:
                result[-1 - at] = box
                continue
            axis, cut = self.axes[at, 0], self.cuts[at, 0]
            left, right = box.copy(), box.copy()
            left[1, axis], right[0, axis] = min(cut, box[1, axis]), max(cut, box[0, axis])
            stack += [(self.children[at, 0], left), (self.children[at, 1], right)]
        return result

    def neighbours(self, here: int, reach: int) -> list[int]:
        """Ranks, rising, that may own a cell within `reach` cells of one of rank `here`; mutual."""
        if self.ranks == 1:
            return []
        boxes = self.boxes()
        gap = np.maximum(boxes[:, 0] - boxes[here, 1], boxes[here, 0] - boxes[:, 1])
        near = (gap <= reach).all(axis=1)
        near[here] = False
        return np.flatnonzero(near).tolist()


def balanced(comm: MPI.Comm, cells: np.ndarray, weights: np.ndarray, shares: np.ndarray | None = None) -> CellPartition:
    """Cuts that give each rank about its share of the weight of cells. Collective; no rank holds all cells.

    shares (ranks,): the same on all ranks, with the sum 1; equal ones unless given.
    cells (n, d) int64, d = 2 or 3: this rank's occupied cells, which others may list too; weights (n,) int64, none
    negative.
    """
    dimension, parts = cells.shape[1], comm.size
    axes, cuts = np.zeros((parts - 1, dimension), np.int64), np.zeros((parts - 1, dimension), np.int64)
    children = np.zeros((parts - 1, 2), np.int64)
    part, made = np.zeros(len(cells), np.int64), 0
    level: list[_Range] = [(0, parts, None)] if parts > 1 else []
    while level:
        wanted = [_left(first, last, shares) for first, last, _ in level]
        order, cut = _cut_level(comm, cells, weights, part, np.array(wanted))
        following: list[_Range] = []
        child_part = np.full((len(level), 2), -1, np.int64)
        for p, (first, last, parent) in enumerate(level):
            axes[made], cuts[made] = order[p], cut[p]
            if parent is not None:
                children[parent] = made
            middle = first + (last - first) // 2
            for side, (lower, upper) in enumerate(((first, middle), (middle, last))):
                if upper - lower == 1:
                    children[made, side] = -1 - lower
                else:
                    child_part[p, side] = len(following)
                    following.append((lower, upper, (made, side)))
            made += 1
        part = _descend(cells, part, order, cut, child_part)
        level = following
    return CellPartition(axes, cuts, children)


def _left(first: int, last: int, shares: np.ndarray | None) -> float:
    """Share of the lower half of some ranks in what all of them have."""
    middle = first + (last - first) // 2
    if shares is None:
        return (middle - first) / (last - first)
    return float(shares[first:middle].sum() / max(shares[first:last].sum(), 1e-300))


def _cut_level(
    comm: MPI.Comm, cells: np.ndarray, weights: np.ndarray, part: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Axis orders and cuts (parts, d) of all parts of a level; wanted (parts,): the share of the left sides."""
    parts, d = len(wanted), cells.shape[1]
    bounds = np.full((parts, 2, d), _FAR, np.int64)
    for p in range(parts):
        if (part == p).any():
            bounds[p] = cells[part == p].min(axis=0), -cells[part == p].max(axis=0)
    with TALKING:
        comm.Allreduce(MPI.IN_PLACE, bounds, MPI.MIN)
    lower, extent = bounds[:, 0], np.maximum(-bounds[:, 1] - bounds[:, 0] + 1, 1)
    order = np.argsort(-extent, axis=1, kind="stable")
    cut, tied = np.zeros((parts, d), np.int64), part >= 0
    target = np.zeros(parts, np.int64)
    for turn in range(d):
        axis = order[:, turn]
        length = extent[np.arange(parts), axis]
        first = np.concatenate(([0], np.cumsum(length)))
        rows, owner = np.flatnonzero(tied), part[tied]
        histogram = np.zeros(first[-1], np.int64)
        np.add.at(histogram, first[owner] + cells[rows, axis[owner]] - lower[owner, axis[owner]], weights[rows])
        with TALKING:
            comm.Allreduce(MPI.IN_PLACE, histogram, MPI.SUM)
        pieces = [histogram[first[q] : first[q + 1]] for q in range(parts)]
        if turn == 0:
            target = np.array([round(share * int(piece.sum())) for share, piece in zip(wanted, pieces)])
        for q, piece in enumerate(pieces):
            k = _place(piece, int(target[q]), nearest=turn == d - 1)
            cut[q, turn] = lower[q, axis[q]] + k
            target[q] -= piece[:k].sum()
        tied[rows] = cells[rows, axis[owner]] == cut[owner, turn]
    return order, cut


def _place(weight: np.ndarray, target: int, nearest: bool) -> int:
    """How many bins fit into the target, or, with `nearest`, come nearest to it."""
    upto = np.cumsum(weight)
    k = int(np.searchsorted(upto, target, side="right"))
    if nearest and k < len(weight) and upto[k] - target <= target - (upto[k - 1] if k else 0):
        k += 1
    # never beyond the last bin: its cells are still to be told apart by the next axis
    return k if nearest else min(k, len(weight) - 1)


def _descend(
    cells: np.ndarray, part: np.ndarray, order: np.ndarray, cut: np.ndarray, child_part: np.ndarray
) -> np.ndarray:
    """Part of each cell in the next level, -1 when its rank is settled."""
    result = np.full(len(part), -1, np.int64)
    for p in range(len(cut)):
        rows = np.flatnonzero(part == p)
        word = cells[rows][:, order[p]]
        left, equal = np.zeros(len(rows), bool), np.ones(len(rows), bool)
        for k in range(word.shape[1]):
            left |= equal & (word[:, k] < cut[p, k])
            equal &= word[:, k] == cut[p, k]
        result[rows] = np.where(left, child_part[p, 0], child_part[p, 1])
    return result
