"""Kernels of contact: colours with their energy, friction, forces, and whether lists are used up.

An entry is a particle and one of the sides of its body. Rows: entries of owned particles first, ghosts behind. Arrays,
with d = dimension: place (n, d) [m], volume (n,) [m^3]; constants (n, 5): c0, 1/s [m], kappa A/2 [N/m], 1/R [1/m],
N R^-d [1/m^d]; record (n, width): q = kappa A g/(2 s) [N], what the impulse at the end of the step has of q beyond it,
and with friction also 1/c, t (d) [N], the weights' b (d) [1/m] and mean place (d) [m]. Sums run in the order of the
lists, which is that of identifiers, so that they do not depend on ranks.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.kernel import shape
from parsolid.kernels import kernel


class Lists(NamedTuple):
    """Neighbours of entry a are neighbour[start[a]] .. neighbour[start[a + 1] - 1]; code (0: none) and table
    (2, codes, 4), R and T of images behind symmetry planes, are None without any; feels (owned,): whether a may press.
    """

    start: Any
    neighbour: Any
    code: Any
    table: Any
    feels: Any


class Matter(NamedTuple):
    """Arrays that the module names, and share (owned,), the part of a particle on this side of symmetry planes."""

    place: Any
    volume: Any
    share: Any
    constants: Any


@register_jitable
def _reflected(code, table, value, k, i, shift):
    # by its argument, for numba to leave out what a scene lacks
    if code is None:
        return value
    return table[0, code[k], i] * value + shift * table[1, code[k], i]


@register_jitable
def put(vector, first, near, k, i, shift):
    """Component first + i of a vector of the neighbour in pair k, or of its image's; shift: 1 of a place, else 0."""
    return _reflected(near.code, near.table, vector[near.neighbour[k], first + i], k, i, shift)


@register_jitable
def distance(matter, near, a, k, x):
    """x_a - x_b into x (3,), and its length over R, where that is less than 1; else 1."""
    square, inverse = 0.0, matter.constants[a, 3]
    for i in range(matter.place.shape[1]):
        x[i] = matter.place[a, i] - put(matter.place, 0, near, k, i, 1.0)
        square += x[i] * x[i]
    square *= inverse * inverse
    return math.sqrt(square) if square < 1.0 else 1.0


@kernel
def may_feel(owned, matter, near, skin, share):
    """1 for owned entries that may see more than a share of their threshold while pairs approach by a skin (owned,)
    [m], else 0."""
    result = np.zeros(owned, np.int64)
    for a in range(owned):
        most = 0.0
        for k in range(near.start[a], near.start[a + 1]):
            square = 0.0
            for i in range(matter.place.shape[1]):
                square += (matter.place[a, i] - put(matter.place, 0, near, k, i, 1.0)) ** 2
            q = max(math.sqrt(square) - skin[a], 0.0) * matter.constants[a, 3]
            most += matter.volume[near.neighbour[k]] * shape(min(q, 1.0))
        result[a] = most * matter.constants[a, 4] > share * matter.constants[a, 0]
    return result


@register_jitable
def crossing(before, now):
    """By how much the impulse at the end of a step differs from now's penetration [m], where it opens or closes a gap.

    Penetration is taken to change evenly in the step. One that begins has acted for the part of the step in which it
    was positive; one that ends has had the whole impulse at the start and gives back what was too much.
    """
    if now > 0.0 >= before:
        return now * (now / (now - before) - 1.0)
    if before > 0.0 >= now:
        return before * now / (before - now)
    return 0.0


@register_jitable
def inverse_of(matrix, d, result):
    """The inverse (3, 3) of a symmetric matrix (d, d), zero where it is singular."""
    trace = 0.0
    for i in range(3):
        trace += matrix[i, i] if i < d else 0.0
        for j in range(3):
            # beyond the dimension the matrix is taken for the identity
            if i >= d or j >= d:
                matrix[i, j] = 1.0 if i == j else 0.0
    for i in range(3):
        for j in range(3):
            k, m, p, r = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            result[j, i] = matrix[k, p] * matrix[m, r] - matrix[k, r] * matrix[m, p]
    determinant = matrix[0, 0] * result[0, 0] + matrix[0, 1] * result[1, 0] + matrix[0, 2] * result[2, 0]
    factor = 1.0 / determinant if determinant > 1e-9 * trace**d else 0.0
    for i in range(3):
        for j in range(3):
            result[i, j] *= factor


@register_jitable
def reaction(matter, near, record, a, k, q, force):
    """Add to a force what friction on the neighbour in pair k gives back to entry a."""
    d, part = matter.place.shape[1], 1.0
    for i in range(d):
        mean = put(record, 3 + 2 * d, near, k, i, 1.0)
        part += put(record, 3 + d, near, k, i, 0.0) * (matter.place[a, i] - mean)
    part *= matter.constants[a, 4] * matter.volume[a] * shape(q) * record[near.neighbour[k], 2]
    for i in range(d):
        force[a, i] -= part * put(record, 3, near, k, i, 0.0)
