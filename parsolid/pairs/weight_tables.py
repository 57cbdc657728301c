"""Lists of pairs of which few weights differ: a pair has the row of a small table in place of its weight.

That is so on lattices, inside of which all pairs of one offset have one weight, where g_ab is rounded to float32 before
the corrections are found: without rounding, places differ in their last bits. A pair takes 6 bytes in place of 36.
"""

from typing import Any

import numpy as np

from decomposition.compiled import compiled
from parsolid.numerics.lanes import WIDTH, aligned_zeros
from parsolid.pairs.lists import InnerList, InnerTable, OneSidedList, OneSidedTable

# most rows, and most of them a pair
_MOST, _SHARE = 1 << 14, 0.25
# steps of a kind differ by what rounding of places leaves, times this
_ROUNDING = 8.0


def is_tabled(pairs: Any) -> bool:
    """Whether weights of a list stand in a table."""
    return isinstance(pairs, InnerTable | OneSidedTable)


@compiled
def _find_kinds(
    pairs: Any,
    bits: np.ndarray,
    positions: np.ndarray,
    rounding: float,
    slots: np.ndarray,
    kind: np.ndarray,
    weights: np.ndarray,
    steps: np.ndarray,
) -> int:
    """Fill kind (m,), and weights (most, 4) and steps X_b - X_a (most, d) of each; how many there are, or -1 where they
    are more than there is room for.

    bits: the weights as integers (m, 4); slots: -1 everywhere, a power of two of them, more than twice the room.
    """
    count, mask, d = 0, slots.shape[0] - 1, positions.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, mixed = pairs.neighbour[k], 0
            for i in range(WIDTH):
                mixed = (mixed ^ bits[k, i]) * 6364136223846793005
                mixed ^= mixed >> 31
            slot = mixed & mask
            while True:
                found = slots[slot]
                if found < 0:
                    break
                same = True
                for i in range(WIDTH):
                    same = same and weights[found, i] == pairs.weight[k, i]
                for i in range(d):
                    same = same and abs(positions[b, i] - positions[a, i] - steps[found, i]) <= rounding
                if same:
                    break
                slot = (slot + 1) & mask
            if found < 0:
                if count == weights.shape[0]:
                    return -1
                found, slots[slot] = count, count
                for i in range(WIDTH):
                    weights[found, i] = pairs.weight[k, i]
                for i in range(d):
                    steps[found, i] = positions[b, i] - positions[a, i]
                count += 1
            kind[k] = found
    return count


def _table(weights: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Rows of a table, see `InnerTable`."""
    table = aligned_zeros((max(len(weights), 1), 2 * WIDTH))
    table[: len(weights), :WIDTH] = weights
    table[: len(weights), WIDTH : WIDTH + steps.shape[1]] = -steps
    return table


def _tabled(pairs: Any, positions: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray] | None:
    """(kind, table) of a list, None where it has more kinds."""
    room = max(most, 1)
    slots = np.full(1 << (2 * room + 1).bit_length(), -1, np.int32)
    kind, weights = np.zeros(len(pairs.neighbour), np.uint16), np.zeros((room, WIDTH))
    steps = np.zeros((room, positions.shape[1]))
    rounding = _ROUNDING * float(np.spacing(np.abs(positions).max(initial=0.0)))
    bits = pairs.weight.view(np.int64)
    count = _find_kinds(pairs, bits, positions, rounding, slots, kind, weights, steps)
    return None if count < 0 else (kind, _table(weights[:count], steps[:count]))


def by_tables(inner: InnerList, rim: OneSidedList | None, positions: np.ndarray) -> tuple[Any, Any] | None:
    """(inner, rim) with tables, or None where pairs inside differ too much; positions (n, d) [m] with ghosts."""
    found = _tabled(inner, positions, min(_MOST, int(_SHARE * len(inner.neighbour))))
    if found is None:
        return None
    ghosts = None if rim is None else _tabled(rim, positions, min(_MOST, len(rim.neighbour)))
    beyond = rim if rim is None or ghosts is None else OneSidedTable(rim.start, rim.neighbour, *ghosts)
    return InnerTable(inner.start, inner.neighbour, *found), beyond


def no_tabled_ghosts(like: InnerTable) -> OneSidedTable:
    """An empty list; like: one of pairs of owned particles."""
    return OneSidedTable(np.zeros(1, np.int64), like.neighbour[:0], like.kind[:0], like.table)
