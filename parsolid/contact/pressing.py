"""Kernels of contact's energy: colours, and the forces of its gradient, four pairs side by side; arrays are as
`contact.passes` says.

What pairs give is added one after the other, in the order of the lists, so that pairs that are listed and too far to
give anything change no bits.
"""

import math

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.contact.kernel import shape, slope
from parsolid.contact.passes import crossing, distance, reaction
from parsolid.numerics.lanes import WIDTH, broadcast, from_floats, fused, lane, load, transpose

# in place of a distance [m] of none, at which nothing acts
_NO_DISTANCE = 1e-300


@register_jitable
def _fill_rows(matter, rows):
    """Places, zero beyond the dimension, and volumes of all entries into rows (n, 4)."""
    for a in range(len(rows)):
        for i in range(3):
            rows[a, i] = matter.place[a, i] if i < matter.place.shape[1] else 0.0
        rows[a, 3] = matter.volume[a]


@register_jitable
def _four_pairs(first, last):
    """Four pairs from the first on; the last one in place of those that are not."""
    most = last - np.uintp(1)
    return (
        first,
        min(first + np.uintp(1), most),
        min(first + np.uintp(2), most),
        min(first + np.uintp(3), most),
    )


@register_jitable
def _imaged(code, table, row, k):
    # by its argument, for numba to leave out what a scene lacks
    if code is None:
        return row
    return fused(row, load(table[0], code[k], 0), load(table[1], code[k], 0))


@register_jitable
def _row(near, rows, k):
    """Place and volume of the neighbour in a pair, or of its image."""
    return _imaged(near.code, near.table, load(rows, np.uintp(near.neighbour[k]), 0), k)


@register_jitable
def _apart(near, rows, own, pairs):
    """x_a - x_b of four pairs, three components, their squares, and the volumes of b."""
    x, y, z, volume = transpose(
        _row(near, rows, pairs[0]), _row(near, rows, pairs[1]), _row(near, rows, pairs[2]), _row(near, rows, pairs[3])
    )
    u, v, w = own[0] - x, own[1] - y, own[2] - z
    return u, v, w, fused(w, w, fused(v, v, u * u)), volume


@register_jitable
def _own(rows, a):
    return broadcast(rows[a, 0]), broadcast(rows[a, 1]), broadcast(rows[a, 2])


@register_jitable
def _colour(near, rows, a, inverse):
    """Colour of an entry, over N R^-d."""
    own, total = _own(rows, a), 0.0
    first, last = np.uintp(near.start[a]), np.uintp(near.start[a + 1])
    while first < last:
        _, _, _, square, volume = _apart(near, rows, own, _four_pairs(first, last))
        seen, left = volume * shape(math.sqrt(square) * inverse), last - first
        total += lane(seen, 0)
        if left > 1:
            total += lane(seen, 1)
        if left > 2:
            total += lane(seen, 2)
        if left > 3:
            total += lane(seen, 3)
        first += np.uintp(WIDTH)
    return total


@compiled(fastmath={"contract"}, error_model="numpy")
def colours(owned, matter, near, new, colour, level, record):
    """Colours, penetrations (owned,) [m] less those at which nothing acts, and q of the owned entries.

    near.feels (owned,): which those are; new: not None where `level` does not hold the penetrations before the step.
    Returns the stored energy [J], the deepest penetration [m] and whose that is.
    """
    energy, deepest, where, constants = 0.0, 0.0, -1, matter.constants
    rows = np.empty((len(matter.place), WIDTH))
    _fill_rows(matter, rows)
    for a in range(owned):
        record[a, 0] = record[a, 1] = colour[a] = 0.0
        if not near.feels[a]:
            level[a] = -1.0 / constants[a, 3]
            continue
        colour[a] = _colour(near, rows, a, constants[a, 3]) * constants[a, 4]
        now = (colour[a] - constants[a, 0]) * constants[a, 1]
        if new is None:
            record[a, 1] = constants[a, 2] * constants[a, 1] * crossing(level[a], now)
        level[a], depth = now, max(0.0, now)
        record[a, 0] = constants[a, 2] * depth * constants[a, 1]
        energy += 0.5 * matter.share[a] * constants[a, 2] * depth * depth
        if depth > deepest:
            deepest, where = depth, a
    return energy, deepest, where


@register_jitable
def _push(matter, near, rows, a, pull):
    """Force on an entry, four lanes, the last of nothing [N], of the gradient of the energy."""
    own, total, zero = _own(rows, a), broadcast(0.0), broadcast(0.0)
    inverse, mine, volume, neighbour = matter.constants[a, 3], pull[a], rows[a, 3], near.neighbour
    factor = -matter.constants[a, 4] * inverse
    first, last = np.uintp(near.start[a]), np.uintp(near.start[a + 1])
    while first < last:
        k, left = _four_pairs(first, last), last - first
        first += np.uintp(WIDTH)
        one, two = pull[np.uintp(neighbour[k[0]])], pull[np.uintp(neighbour[k[1]])]
        three, four = pull[np.uintp(neighbour[k[2]])], pull[np.uintp(neighbour[k[3]])]
        if mine == 0.0 and one == 0.0 and two == 0.0 and three == 0.0 and four == 0.0:
            continue
        u, v, w, square, others = _apart(near, rows, own, k)
        length = max(math.sqrt(square), _NO_DISTANCE)
        both = fused(mine, others, from_floats(one, two, three, four) * volume)
        over = factor * slope(length * inverse) * both / length
        parts = transpose(over * u, over * v, over * w, zero)
        total = total + parts[0]
        if left > 1:
            total = total + parts[1]
        if left > 2:
            total = total + parts[2]
        if left > 3:
            total = total + parts[3]
    return total


@compiled(fastmath={"contract"}, error_model="numpy")
def forces(owned, matter, near, record, column, rubbing, force):
    """Forces (owned, d) [N] on the owned entries: the gradient of the energy, and friction where `rubbing` is not None;
    of the particle as a whole where a symmetry plane cuts it. column: of the record, that of q. Returns whether any
    entry has one."""
    d, pull, x, acts = matter.place.shape[1], record[:, column].copy(), np.empty(3), False
    rows = np.empty((len(matter.place), WIDTH))
    for a in range(len(pull)):
        acts = acts or pull[a] != 0.0
    if acts:
        _fill_rows(matter, rows)
    for a in range(owned):
        for i in range(d):
            force[a, i] = 0.0 if rubbing is None else record[a, 3 + i]
        if not acts:
            continue
        total = _push(matter, near, rows, a, pull)
        force[a, 0] += lane(total, 0)
        if d > 1:
            force[a, 1] += lane(total, 1)
        if d > 2:
            force[a, 2] += lane(total, 2)
        if rubbing is not None:
            for k in range(near.start[a], near.start[a + 1]):
                if record[near.neighbour[k], 2] > 0.0:
                    q = distance(matter, near, a, k, x)
                    if q < 1.0:
                        reaction(matter, near, record, a, k, q, force)
    return acts
