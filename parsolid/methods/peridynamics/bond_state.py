"""Which bonds of a particle are broken, as bits that do not depend on how the particles are spread over ranks.

Bit r of a particle stands for its r-th neighbour in the order of (image code + 1, or 0 without a mirror; identifier).
Only particles that have broken bonds are looked at: `slot` (n,) holds their rows in the compressed arrays, or -1.
"""

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.pairs.lists import images_of, mutual

BITS = 63
_IDENTIFIERS = np.int64(1) << 52


@compiled
def count_neighbours(pairs, slot, count):
    """Add the number of neighbours, broken or not, of the particles with a slot to count (slots,)."""
    for a in range(len(pairs.start) - 1):
        if slot[a] >= 0:
            count[slot[a]] += pairs.start[a + 1] - pairs.start[a]
        if mutual(pairs):
            for k in range(pairs.start[a], pairs.start[a + 1]):
                if slot[pairs.neighbour[k]] >= 0:
                    count[slot[pairs.neighbour[k]]] += 1


@register_jitable
def _code(images, k):
    """0 of a neighbour, more of its images."""
    if images is None:
        return 0
    return images.code[k] + 1


@compiled
def list_neighbours(pairs, number, slot, identifier, cursor, key, source):
    """Append each neighbour's key (m,) and source (m, 2), the number of the list and the pair in it, at cursor
    (slots,).
    """
    images = images_of(pairs)
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], _code(images, k)
            if slot[a] >= 0:
                _append(slot[a], code, identifier[b], number, k, cursor, key, source)
            if mutual(pairs) and slot[b] >= 0:
                _append(slot[b], code, identifier[a], number, k, cursor, key, source)


@compiled
def _append(row, code, identifier, number, k, cursor, key, source):
    position = cursor[row]
    key[position] = code * _IDENTIFIERS + identifier
    source[position, 0], source[position, 1] = number, k
    cursor[row] += 1


@compiled
def sort_neighbours(start, key, source):
    """Order each row's keys and sources, rows start[i] : start[i + 1], by key."""
    for i in range(len(start) - 1):
        row = slice(start[i], start[i + 1])
        order = np.argsort(key[row])
        key[row] = key[row][order]
        source[row] = source[row][order]


@compiled
def write_bits(start, broken, words):
    """Bits of words (slots, w) int64 from broken (m,), in the order of the rows."""
    words[:] = 0
    for i in range(len(start) - 1):
        for r in range(start[i + 1] - start[i]):
            if broken[start[i] + r]:
                words[i, r // BITS] |= np.int64(1) << (r % BITS)


@compiled
def read_bits(start, words, broken):
    """The inverse of `write_bits`."""
    for i in range(len(start) - 1):
        for r in range(start[i + 1] - start[i]):
            broken[start[i] + r] = (words[i, r // BITS] >> (r % BITS)) & 1
