"""Lists of pairs in which as many particles as lanes are wide follow one another, as do their neighbours: lattices.

Pairs of such a block that have the same number of rows between both particles stand in lanes beside one another, so
that neighbours are loaded as they lie. Blocks of a lattice have few different patterns of such pairs, rows that end and
begin anew in a block included: a block has the number of its pattern, and no list of neighbours.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.compiled import compiled
from parsolid.numerics.lanes import WIDTH, aligned_zeros
from parsolid.numerics.wide_lanes import WIDE
from parsolid.pairs.lists import InnerTable

# columns of the window through which particles pass, a constant of the kernels: no multiple of a page
STRIDE = (1 << 15) + 40
# rows of the window; see `block_passes`
ROWS = 32
# most pairs of a pattern; least part of its lanes that pairs fill
_MOST, _FILLED = 128, 0.4
# most of the window that lies ahead of a block
_AHEAD = STRIDE - 4096
# of fewer pairs a particle tables are as fast, and faster with more particles than this, in the plane and in space,
# whose records and the window do not stay in the caches (docs/performance.md)
_FEW, _MANY = {2: 6, 3: 12}, {2: 80_000, 3: 50_000}
# steps of pairs that differ by less than this part of the longest are the same
_SAME = 1e-9


class Patterns(NamedTuple):
    """The pairs of blocks: entries first[p] : first[p+1] are those of the pattern p (int64).

    rows (m,) int32: from a particle to its neighbour, all > 0. shape (m,) uint16: row of `shapes` (shapes, 8), g_ab
    over a power of two and X_a - X_b, each padded to 4. lanes (2 m WIDE,): that power and then k_ab of each particle of
    a block, 0 where one has no such pair.
    """

    first: np.ndarray
    rows: np.ndarray
    shape: np.ndarray
    lanes: np.ndarray
    shapes: np.ndarray


class InnerBlocks(NamedTuple):
    """Each pair of owned particles once, both receive.

    block (blocks,) int32: pattern of the WIDE particles from WIDE i on, -1 where it has none. ahead (1,): how many rows
    a block reaches. window (ROWS * STRIDE,): see `block_passes`. others: pairs of blocks without a pattern.
    """

    block: np.ndarray
    patterns: Patterns
    ahead: np.ndarray
    window: np.ndarray
    others: InnerTable


def is_in_blocks(pairs: Any) -> bool:
    """Whether a list is one of this module."""
    return isinstance(pairs, InnerBlocks)


def touched(pairs: InnerBlocks) -> np.ndarray:
    """The columns of the window that passes have come to, a copy: only they take memory."""
    window = pairs.window.reshape(ROWS, STRIDE)
    return window[:, window.any(axis=0)]


def pairs_in_blocks(pairs: InnerBlocks) -> int:
    """How many pairs a list has."""
    return int(neighbours_in_blocks(pairs, len(pairs.others.start) - 1).sum()) // 2


def neighbours_in_blocks(pairs: InnerBlocks, owned: int) -> np.ndarray:
    """How many neighbours (owned,) particles have in a list."""
    result = np.diff(pairs.others.start) + np.bincount(pairs.others.neighbour, minlength=owned)
    _count_neighbours(pairs.block, pairs.patterns, result)
    return result


@compiled
def _count_neighbours(block: np.ndarray, patterns: Patterns, count: np.ndarray) -> None:
    for i in range(block.shape[0]):
        if block[i] < 0:
            continue
        for k in range(patterns.first[block[i]], patterns.first[block[i] + 1]):
            for lane in range(WIDE):
                if patterns.lanes[2 * WIDE * k + lane] != 0.0:
                    count[WIDE * i + lane] += 1
                    count[WIDE * i + lane + patterns.rows[k]] += 1


@compiled
def _entries(
    pairs: Any, a: int, shape_of: np.ndarray, told: np.ndarray, rows: np.ndarray, shape: np.ndarray, lanes: np.ndarray
) -> tuple[int, int]:
    """Fill rows, shape (most,) and lanes (most, 2 WIDE) with the pairs of the block from a on; (entries, pairs), and -1
    for entries where there are too many or a pair is not its first particle's. told (kinds, 2): power and k_ab."""
    count, total, n = 0, 0, pairs.start.shape[0] - 1
    for lane in range(min(WIDE, n - a)):
        place = 0
        for k in range(pairs.start[a + lane], pairs.start[a + lane + 1]):
            apart, kind = pairs.neighbour[k] - (a + lane), pairs.kind[k]
            while place < count and (rows[place] < apart or (rows[place] == apart and shape[place] < shape_of[kind])):
                place += 1
            if apart <= 0:
                return -1, total
            if place == count or rows[place] != apart or shape[place] != shape_of[kind]:
                if count == rows.shape[0]:
                    return -1, total
                for later in range(count, place, -1):
                    rows[later], shape[later] = rows[later - 1], shape[later - 1]
                    lanes[later] = lanes[later - 1]
                rows[place], shape[place], lanes[place] = apart, shape_of[kind], 0.0
                count += 1
            lanes[place, lane], lanes[place, WIDE + lane] = told[kind, 0], told[kind, 1]
            total += 1
    return count, total


@compiled
def _same_as(found: int, patterns: Patterns, rows: Any, shape: Any, lanes: Any, count: int) -> bool:
    first = patterns.first[found]
    if patterns.first[found + 1] - first != count:
        return False
    for k in range(count):
        if patterns.rows[first + k] != rows[k] or patterns.shape[first + k] != shape[k]:
            return False
        for lane in range(2 * WIDE):
            if patterns.lanes[2 * WIDE * (first + k) + lane] != lanes[k, lane]:
                return False
    return True


@compiled
def _mixed(number: int, value: int) -> int:
    mixed = (number ^ value) * 6364136223846793005
    return mixed ^ mixed >> 31


@compiled
def _find_patterns(
    pairs: Any, shape_of: np.ndarray, told: np.ndarray, slots: np.ndarray, block: np.ndarray, patterns: Patterns
) -> int:
    """Fill block, -1 where a block is left to the list, and the patterns; how many there are.

    shape_of, told: of each kind of the table; slots: -1 everywhere, a power of two, more than twice the blocks.
    """
    rows, shape = np.zeros(_MOST, np.int32), np.zeros(_MOST, np.uint16)
    lanes = np.zeros((_MOST, 2 * WIDE))
    bits, number, mask = lanes.view(np.int64), 0, slots.shape[0] - 1
    for i in range(block.shape[0]):
        count, total = _entries(pairs, WIDE * i, shape_of, told, rows, shape, lanes)
        block[i] = -1
        if count < 0 or total < _FILLED * WIDE * count:
            continue
        mixed = count
        for k in range(count):
            mixed = _mixed(mixed, np.int64(rows[k]))
            mixed = _mixed(mixed, np.int64(shape[k]))
            for lane in range(2 * WIDE):
                mixed = _mixed(mixed, bits[k, lane])
        slot = mixed & mask
        while slots[slot] >= 0 and not _same_as(slots[slot], patterns, rows, shape, lanes, count):
            slot = (slot + 1) & mask
        if slots[slot] < 0:
            first, slots[slot] = patterns.first[number], number
            for k in range(count):
                patterns.rows[first + k], patterns.shape[first + k] = rows[k], shape[k]
                patterns.lanes[2 * WIDE * (first + k) : 2 * WIDE * (first + k + 1)] = lanes[k]
            number += 1
            patterns.first[number] = first + count
        block[i] = slots[slot]
    return number


def _shapes(table: np.ndarray, dimension: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(row of each kind (kinds,) uint16, its power of two and k_ab (kinds, 2), shapes)."""
    g, step = table[:, :dimension], table[:, WIDTH:]
    power = np.exp2(np.frexp(np.abs(g).max(axis=1, initial=0.0))[1])
    alike = np.round(step / (_SAME * max(np.abs(step).max(initial=0.0), 1e-300)))
    _, found, shape_of = np.unique(
        np.hstack((g / power[:, None], alike)), axis=0, return_index=True, return_inverse=True
    )
    shapes = aligned_zeros((len(found), 2 * WIDTH))
    shapes[:, :dimension], shapes[:, WIDTH:] = (g / power[:, None])[found], step[found]
    return shape_of.ravel().astype(np.uint16), np.column_stack((power, table[:, dimension])), shapes


def in_blocks(inner: InnerTable, dimension: int) -> InnerBlocks | None:
    """A list by blocks, None where few particles are in such, and where tables are faster."""
    n, pairs = len(inner.start) - 1, len(inner.neighbour)
    if pairs < _FEW[dimension] * n and n > _MANY[dimension]:
        return None
    blocks = -(-n // WIDE)
    shape_of, told, shapes = _shapes(inner.table, dimension)
    room = int(pairs / (_FILLED * WIDE)) + 1
    whole = Patterns(
        np.zeros(blocks + 1, np.int64),
        np.zeros(room, np.int32),
        np.zeros(room, np.uint16),
        np.zeros(room * 2 * WIDE),
        shapes,
    )
    block, slots = np.zeros(blocks, np.int32), np.full(1 << (2 * blocks + 1).bit_length(), -1, np.int32)
    number = _find_patterns(inner, shape_of, told, slots, block, whole)
    ahead = int(whole.rows.max(initial=0)) + 2 * WIDE
    left = np.repeat(block < 0, WIDE)[:n]
    if ahead > _AHEAD or 2 * left.sum() > n:
        return None
    last = whole.first[number]
    lanes = aligned_zeros(last * 2 * WIDE)
    lanes[:] = whole.lanes[: len(lanes)]
    patterns = Patterns(
        whole.first[: number + 1].copy(), whole.rows[:last].copy(), whole.shape[:last].copy(), lanes, shapes
    )
    degree = np.diff(inner.start)
    of_others = np.repeat(left, degree)
    start = np.concatenate(([0], np.cumsum(np.where(left, degree, 0))))
    others = InnerTable(start, inner.neighbour[of_others], inner.kind[of_others], inner.table)
    return InnerBlocks(block, patterns, np.array([ahead]), aligned_zeros(ROWS * STRIDE), others)
