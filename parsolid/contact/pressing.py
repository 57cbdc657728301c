"""Kernels of contact's energy: colours, and the forces of its gradient; arrays are as `contact.passes` says.

What pairs give is worked out side by side for the pairs of an entry, and added one after the other, in the order of the
lists, so that pairs that are listed and too far to give anything change no bits.
"""

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.kernel import shape, slope
from parsolid.contact.passes import crossing, distance, reaction
from parsolid.kernels import kernel

# in place of a distance [m] of none, at which nothing acts
_NO_DISTANCE = 1e-300


@register_jitable
def _rows(matter):
    """Places, zero beyond the dimension, and volumes of all entries (n, 4)."""
    rows = np.zeros((len(matter.place), 4))
    for a in range(len(rows)):
        for i in range(matter.place.shape[1]):
            rows[a, i] = matter.place[a, i]
        rows[a, 3] = matter.volume[a]
    return rows


@register_jitable
def _longest(start):
    most = 0
    for a in range(len(start) - 1):
        most = max(most, start[a + 1] - start[a])
    return most


@register_jitable
def _imaged(code, table, value, k, i):
    # by its argument, for numba to leave out what a scene lacks
    if code is None:
        return value
    return table[0, code[k], i] * value + table[1, code[k], i]


@register_jitable
def _apart(near, rows, a, k):
    """x_a - x_b of a pair [m], its square, and the volume of b."""
    b = near.neighbour[k]
    u = rows[a, 0] - _imaged(near.code, near.table, rows[b, 0], k, 0)
    v = rows[a, 1] - _imaged(near.code, near.table, rows[b, 1], k, 1)
    w = rows[a, 2] - _imaged(near.code, near.table, rows[b, 2], k, 2)
    return u, v, w, u * u + v * v + w * w, rows[b, 3]


@kernel
def colours(owned, matter, near, new, colour, level, record):
    """Colours, penetrations (owned,) [m] less those at which nothing acts, and q of the owned entries.

    near.feels (owned,): which those are; new: not None where `level` does not hold the penetrations before the step.
    Returns the stored energy [J], the deepest penetration [m] and whose that is.
    """
    energy, deepest, where, constants = 0.0, 0.0, -1, matter.constants
    rows, seen = _rows(matter), np.empty(_longest(near.start))
    for a in range(owned):
        record[a, 0] = record[a, 1] = colour[a] = 0.0
        inverse = constants[a, 3]
        if not near.feels[a]:
            level[a] = -1.0 / inverse
            continue
        first, count = near.start[a], near.start[a + 1] - near.start[a]
        for k in range(count):
            _, _, _, square, volume = _apart(near, rows, a, first + k)
            seen[k] = volume * shape(square**0.5 * inverse)
        total = 0.0
        for k in range(count):
            total += seen[k]
        colour[a] = total * constants[a, 4]
        now = (colour[a] - constants[a, 0]) * constants[a, 1]
        if new is None:
            record[a, 1] = constants[a, 2] * constants[a, 1] * crossing(level[a], now)
        level[a], depth = now, max(0.0, now)
        record[a, 0] = constants[a, 2] * depth * constants[a, 1]
        energy += 0.5 * matter.share[a] * constants[a, 2] * depth * depth
        if depth > deepest:
            deepest, where = depth, a
    return energy, deepest, where


@kernel
def forces(owned, matter, near, record, column, rubbing, force):
    """Forces (owned, d) [N] on the owned entries: the gradient of the energy, and friction where `rubbing` is not None;
    of the particle as a whole where a symmetry plane cuts it. column: of the record, that of q. Returns whether any
    entry has one."""
    d, pull, x, acts = matter.place.shape[1], record[:, column].copy(), np.empty(3), False
    for a in range(len(pull)):
        acts = acts or pull[a] != 0.0
    for a in range(owned):
        for i in range(d):
            force[a, i] = 0.0 if rubbing is None else record[a, 3 + i]
    if not acts:
        return acts
    rows, push = _rows(matter), np.empty((3, _longest(near.start)))
    for a in range(owned):
        first, count = near.start[a], near.start[a + 1] - near.start[a]
        mine, presses = pull[a], pull[a] != 0.0
        for k in range(count):
            presses = presses or pull[near.neighbour[first + k]] != 0.0
        if presses:
            inverse = matter.constants[a, 3]
            factor = -matter.constants[a, 4] * inverse
            for k in range(count):
                u, v, w, square, volume = _apart(near, rows, a, first + k)
                length = max(square**0.5, _NO_DISTANCE)
                both = mine * volume + pull[near.neighbour[first + k]] * rows[a, 3]
                over = factor * slope(length * inverse) * both / length
                push[0, k], push[1, k], push[2, k] = over * u, over * v, over * w
            for i in range(d):
                total = 0.0
                for k in range(count):
                    total += push[i, k]
                force[a, i] += total
        if rubbing is not None:
            for k in range(first, first + count):
                if record[near.neighbour[k], 2] > 0.0:
                    q = distance(matter, near, a, k, x)
                    if q < 1.0:
                        reaction(matter, near, record, a, k, q, force)
    return acts
