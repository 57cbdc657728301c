"""Cells of a lattice that hold particles, and the nodes of their stencils; nothing exists far from particles.

The stencil of a cell is the block of `width` nodes a direction that begins at the node of the cell's own index. Cells
and nodes have whole-number indices; a word of 63 bits made of an index orders them lexicographically, first direction
first.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

# indices from -2**20 to 2**20 - 1 along each direction
_BITS = 21
FARTHEST = 1 << (_BITS - 1)
_LOST = -2


class Mirror(NamedTuple):
    """A mirror plane through nodes or half-way between them: index[axis] = doubled / 2; side +1 when matter is above,
    -1 below.
    """

    axis: int
    doubled: int
    side: int


def words(indices: np.ndarray) -> np.ndarray:
    """Words (n,) int64 of indices (n, d), in their lexicographic order."""
    result = np.zeros(len(indices), np.int64)
    for column in indices.T:
        result = (result << _BITS) + (column + FARTHEST)
    return result


def indices_of(word: np.ndarray, dimension: int) -> np.ndarray:
    """Indices (n, d) of words."""
    result = np.empty((len(word), dimension), np.int64)
    for axis in range(dimension - 1, -1, -1):
        result[:, axis] = (word & ((1 << _BITS) - 1)) - FARTHEST
        word = word >> _BITS
    return result


@njit(cache=True)
def _locate(bases: np.ndarray, owned: int, cells: np.ndarray, cell: np.ndarray, start: np.ndarray) -> int:
    """Cell number of each particle and how many each cell has, in start[1:]; returns how many particles have no cell.

    cell: a guess of each particle's cell on entry, as of the step before; -1 where its cell is not listed, -2 where its
    index is beyond the lattice.
    """
    start[:] = 0
    missing, count = 0, len(cells)
    c: Any = 0
    for p in range(owned):
        word = np.int64(0)
        inside: Any = True
        for k in range(bases.shape[1]):
            shifted = np.int64(bases[p, k]) + FARTHEST
            inside = inside and 0 <= shifted < 2 * FARTHEST
            word = (word << _BITS) + shifted
        if not inside:
            cell[p] = _LOST
            missing += 1
            continue
        guess = cell[p]
        if 0 <= guess < count and cells[guess] == word:
            start[guess + 1] += 1
            continue
        # as its neighbour in storage, most likely
        if c >= count or cells[c] != word:
            c = np.searchsorted(cells, word)
            if c >= count or cells[c] != word:
                cell[p] = -1
                missing += 1
                continue
        cell[p] = c
        start[c + 1] += 1
    return missing


@njit(cache=True)
def _fill(cell: np.ndarray, owned: int, start: np.ndarray, cursor: np.ndarray, order: np.ndarray) -> None:
    """Turn counts into starts and list the particles of each cell, in the order of storage."""
    for c in range(len(start) - 1):
        start[c + 1] += start[c]
        cursor[c] = start[c]
    for p in range(owned):
        if cell[p] >= 0:
            order[cursor[cell[p]]] = p
            cursor[cell[p]] += 1


def with_neighbours(cells: np.ndarray) -> np.ndarray:
    """Cells (n, d) and those that touch them (m, d) int64, each once; of cells at the lattice's end, these alone."""
    inner = (np.abs(cells) < FARTHEST - 1).all(axis=1)
    word = words(cells[inner])
    for axis in range(cells.shape[1]):
        shift = 1 << (axis * _BITS)
        word = np.unique(np.concatenate((word - shift, word, word + shift)))
    return np.concatenate((indices_of(word, cells.shape[1]), cells[~inner]))


def _unlisted(word: np.ndarray, listed: np.ndarray) -> np.ndarray:
    """Those words that are not in a sorted list, sorted, each once."""
    word = np.unique(word)
    place = np.searchsorted(listed, word)
    known = np.zeros(len(word), bool)
    inside = place < len(listed)
    known[inside] = listed[place[inside]] == word[inside]
    return word[~known]


class OccupiedCells:
    """Cells in lexicographic order with their particles, and their nodes.

    index (cells, d) int64; stencil (cells, width**d) int32 slots of nodes, last direction fastest; start (cells + 1,),
    order (owned,) int64: particles of cell c are order[start[c] : start[c + 1]]. nodes (count, d) int64: indices by
    slot, and node_words, in lexicographic order. Cells stay when their particles have left, until `keep` or `clear`.
    `version` counts changes of cells or nodes, which may change all slots.
    """

    def __init__(
        self,
        dimension: int,
        width: int,
        mirrors: tuple[Mirror, ...] = (),
        further: tuple[tuple[int, int], ...] = (),
    ) -> None:
        """further: axes and directions (1 or -1) in which nodes next to those of stencils are listed as well."""
        self.dimension, self.width, self.mirrors, self.further = dimension, width, mirrors, further
        offsets = np.meshgrid(*[np.arange(width)] * dimension, indexing="ij")
        self._offsets = np.stack([axis.ravel() for axis in offsets], axis=1)
        self.version = 0
        self.order, self._cell = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self.clear()

    def clear(self) -> None:
        """Forget all cells and nodes; `sort` must follow."""
        self.version += 1
        self._cell[:] = -1
        self._words = np.zeros(0, np.int64)
        self.index = np.zeros((0, self.dimension), np.int64)
        self.stencil = np.zeros((0, self.width**self.dimension), np.int32)
        self.start = np.zeros(1, np.int64)
        self.nodes = np.zeros((0, self.dimension), np.int64)
        self.node_words = np.zeros(0, np.int64)

    @property
    def occupied(self) -> np.ndarray:
        """Which cells have particles (cells,) bool."""
        return np.diff(self.start) > 0

    def sort(self, bases: np.ndarray, owned: int) -> np.ndarray:
        """List the particles cell by cell, in the order of storage.

        bases (capacity, d): cell of each particle. Returns the rows of those whose cell is not listed; they are in no
        cell.
        """
        if len(self.order) < owned:
            self.order, self._cell = np.zeros((2, owned + owned // 4), np.int64)
        missing = _locate(bases, owned, self._words, self._cell, self.start)
        _fill(self._cell, owned, self.start, np.empty(len(self.start), np.int64), self.order)
        return np.flatnonzero(self._cell[:owned] < 0) if missing else np.zeros(0, np.int64)

    def breaks(self, owned: int) -> int:
        """How often the list of particles does not go on with the next one in storage."""
        return int(np.count_nonzero(np.diff(self.order[:owned]) != 1))

    def arrays(self) -> list[np.ndarray]:
        """Arrays that count as memory."""
        return [self.index, self.stencil, self.start, self.order, self.nodes]

    def lost(self, rows: np.ndarray) -> np.ndarray:
        """Which of the rows that `sort` returned are beyond the lattice (or not numbers)."""
        return self._cell[rows] == _LOST

    def add(self, cells: np.ndarray) -> None:
        """List further cells (n, d), in any order, known ones and repeated ones too; `sort` must follow."""
        new = _unlisted(words(cells), self._words)
        if len(new) == 0:
            return
        listed = self._cell >= 0
        self._cell[listed] += np.searchsorted(new, self._words)[self._cell[listed]] if len(self._words) else 0
        index = indices_of(new, self.dimension)
        # nodes of the stencils, last direction fastest
        stencils = (index[:, None, :] + self._offsets).reshape(-1, self.dimension)
        slots = self._slots_of_nodes(stencils).reshape(len(new), -1)
        place = np.searchsorted(self._words, new)
        self._words = np.insert(self._words, place, new)
        self.index = np.insert(self.index, place, index, axis=0)
        self.stencil = np.insert(self.stencil, place, slots, axis=0)
        self.start = np.zeros(len(self._words) + 1, np.int64)
        self.version += 1

    def _slots_of_nodes(self, nodes: np.ndarray) -> np.ndarray:
        """Slots of nodes (n, d), which are listed if they are not yet, together with their mirror images."""
        wanted, back = np.unique(words(nodes), return_inverse=True)
        all_wanted = [wanted, *(wanted + (way << _BITS * (self.dimension - 1 - axis)) for axis, way in self.further)]
        unknown = indices_of(_unlisted(np.concatenate(all_wanted), self.node_words), self.dimension)
        for mirror in self.mirrors:
            unknown = np.concatenate((unknown, reflected(unknown, mirror, self.width)[1]))
        new = _unlisted(words(unknown), self.node_words)
        if len(new):
            # sums over slots in their order have the same bits, whenever their nodes were listed
            moved = np.arange(len(self.nodes)) + np.searchsorted(new, self.node_words)
            self.stencil = moved.astype(np.int32)[self.stencil]
            self.node_words = np.insert(self.node_words, np.searchsorted(self.node_words, new), new)
            self.nodes = indices_of(self.node_words, self.dimension)
        return self.slots(wanted)[back.ravel()]

    def slots(self, word: np.ndarray) -> np.ndarray:
        """Slots of nodes by their words, -1 where there is no such node."""
        if len(self.node_words) == 0:
            return np.full(len(word), -1, np.int32)
        place = np.minimum(np.searchsorted(self.node_words, word), len(self.node_words) - 1)
        return np.where(self.node_words[place] == word, place, -1).astype(np.int32)

    def keep(self, cells: np.ndarray) -> None:
        """List these cells (n, d) and no others; `sort` must follow."""
        self.clear()
        self.add(cells)

    def mirrored(self, mirror: Mirror) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Slots of the nodes behind a mirror plane, slots of their images before it, and slots of the nodes on it."""
        behind, images = reflected(self.nodes, mirror, self.width, behind=True)
        partners = self.slots(words(images))
        on_plane = np.flatnonzero(2 * self.nodes[:, mirror.axis] == mirror.doubled)
        paired = partners >= 0
        return behind[paired], partners[paired].astype(np.int64), on_plane


def reflected(nodes: np.ndarray, mirror: Mirror, width: int, behind: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Rows of nodes within `width` of a mirror plane, those behind it only or on both sides, and the
    images' indices.
    """
    distance = mirror.side * (2 * nodes[:, mirror.axis] - mirror.doubled)
    rows = np.flatnonzero((distance < 0) & (distance >= -2 * width) if behind else np.abs(distance) <= 2 * width)
    images = nodes[rows].copy()
    images[:, mirror.axis] = mirror.doubled - images[:, mirror.axis]
    return rows, images
