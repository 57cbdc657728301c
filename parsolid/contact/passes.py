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

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.contact.kernel import shape, slope


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


@compiled(error_model="numpy")
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
def moments(matter, near, a, weight, w):
    """Of the other body around an entry: direction away from it (unit) in w[0], mean place relative to the entry in
    w[1], b in w[2]; the length of grad c R/(N R^-d)."""
    d, n, mean, b_, x, matrix, solved = matter.place.shape[1], w[0], w[1], w[2], w[3], w[6:9], w[9:12]
    w[:3], w[6:9] = 0.0, 0.0
    for k in range(near.start[a], near.start[a + 1]):
        q = distance(matter, near, a, k, x)
        if q < 1.0:
            V = matter.volume[near.neighbour[k]]
            part, pull = weight * V * shape(q), V * slope(q) * matter.constants[a, 3] / max(q, 1e-300)
            for i in range(d):
                n[i] -= pull * x[i]
                mean[i] -= part * x[i]
                for j in range(d):
                    matrix[i, j] += part * x[i] * x[j]
    length = 0.0
    for i in range(d):
        length += n[i] * n[i]
        for j in range(d):
            matrix[i, j] -= mean[i] * mean[j]
    length = math.sqrt(length)
    inverse_of(matrix, d, solved)
    for i in range(d):
        n[i] /= max(length, 1e-300)
        for j in range(d):
            b_[i] -= solved[i, j] * mean[j]
    return length


@register_jitable
def slip(matter, near, a, weight, moved, w):
    """Displacement of the entry in a step, against that of the other body where it is, into w[4]."""
    d, mean, b_, x, u = matter.place.shape[1], w[1], w[2], w[3], w[4]
    for i in range(d):
        u[i] = moved[a, i]
    for k in range(near.start[a], near.start[a + 1]):
        q = distance(matter, near, a, k, x)
        if q < 1.0:
            part = 1.0
            for i in range(d):
                part -= b_[i] * (x[i] + mean[i])
            part *= weight * matter.volume[near.neighbour[k]] * shape(q)
            for i in range(d):
                u[i] -= part * put(moved, 0, near, k, i, 0.0)


@register_jitable
def slide(d, n, u, stick, old, rigidity, most):
    """The stick history (d,) [m] of an entry turned into the present plane at its length, with the slip u of the step,
    cut where its force exceeds `most` [N]; what is dissipated [J]."""
    along, normal, before, after, square, lost = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(d):
        along += n[i] * stick[i]
        normal += n[i] * u[i]
    for i in range(d):
        old[i] = stick[i] - along * n[i]
        before += stick[i] * stick[i]
        after += old[i] * old[i]
    turned = math.sqrt(before / after) if after > 0.0 else 0.0
    for i in range(d):
        old[i] *= turned
        u[i] = old[i] + u[i] - normal * n[i]
        square += u[i] * u[i]
    trial = rigidity * math.sqrt(square)
    scale = most / trial if trial > most else 1.0
    for i in range(d):
        stick[i] = scale * u[i]
        lost += 0.5 * rigidity * (old[i] + stick[i]) * (u[i] - stick[i])
    return lost


@compiled(error_model="numpy")
def friction(owned, held, matter, near, moved, coefficient, colour, stick, record, lost):
    """Stick history (owned, d) [m] and the tangential force t of every entry that presses, with its weights.

    moved (n, d) [m]: displacement in the step; held: not None where the history stays as it is. Weights exact for
    linear fields: w_j [1 + b . (x_j - xm)]. Sets lost (owned,), what is dissipated; returns the stick energy [J].
    """
    d, stored, w = matter.place.shape[1], 0.0, np.zeros((12, 3))
    for a in range(owned):
        rigidity, record[a, 2:], lost[a] = matter.constants[a, 2], 0.0, 0.0
        half = 0.5 * matter.share[a] * rigidity
        if not (record[a, 0] > 0.0 and coefficient[a] > 0.0):
            # opened: what the tangential spring held is gone
            for i in range(d):
                lost[a] += half * stick[a, i] * stick[a, i]
                stick[a, i] = 0.0
            continue
        weight = matter.constants[a, 4] / colour[a]
        length = moments(matter, near, a, weight, w)
        if held is None:
            slip(matter, near, a, weight, moved, w)
            most = coefficient[a] * record[a, 0] * length * matter.constants[a, 4] * matter.constants[a, 3]
            lost[a] = matter.share[a] * slide(d, w[0], w[4], stick[a], w[5], rigidity, most)
        record[a, 2] = 1.0 / colour[a]
        for i in range(d):
            stored += half * stick[a, i] * stick[a, i]
            record[a, 3 + i] = -rigidity * stick[a, i]
            record[a, 3 + d + i] = w[2, i]
            record[a, 3 + 2 * d + i] = matter.place[a, i] + w[1, i]
    return stored


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
