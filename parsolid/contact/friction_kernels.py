"""Kernel of friction: weights exact for linear fields, slips, springs that stick and slide; arrays as in `passes`."""

import math

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.kernel import shape, slope
from parsolid.contact.passes import distance, inverse_of, put
from parsolid.kernels import kernel

# of its threshold, what an entry that presses no more sees at least of the body that it rubbed on, for its weights
_GONE = 0.5


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
    cut where its force exceeds `most` [N]; what is dissipated [J].

    A spring that a step turns round, while what presses falls, has acted at its whole old length for half of it. It
    keeps as much of the old force as makes friction take nothing, for one step and never more than it had.
    """
    along, normal, before, after, square, back, lost = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
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
        back -= old[i] * u[i]
    trial = rigidity * math.sqrt(square)
    scale = most / trial if trial > most else 1.0
    kept = min(back / square, 1.0) if scale < 1.0 else 0.0
    for i in range(d):
        stick[i] = max(scale, kept) * u[i]
        lost += 0.5 * rigidity * (old[i] + stick[i]) * (u[i] - stick[i])
    return 0.0 if kept > scale else lost


@register_jitable
def let_go(matter, near, a, held, moved, colour, stick, record, w):
    """What friction takes [J] of an entry that presses no more, whose stick history (d,) [m] ends: what its spring held
    less the work of the half impulse that this gave in the step; never less than nothing. record (width,): gets 1/c,
    by which the other body has its half of the heat."""
    d, rigidity, whole, worked = matter.place.shape[1], matter.constants[a, 2], 0.0, 0.0
    for i in range(d):
        whole += stick[i] * stick[i]
    # where it hardly sees the other body any more no weights are exact
    if held is None and whole > 0.0 and colour > _GONE * matter.constants[a, 0]:
        weight, record[2] = matter.constants[a, 4] / colour, 1.0 / colour
        moments(matter, near, a, weight, w)
        slip(matter, near, a, weight, moved, w)
        for i in range(d):
            worked += stick[i] * w[4, i]
    for i in range(d):
        stick[i] = 0.0
    return max(0.5 * rigidity * (whole + worked), 0.0)


@kernel
def friction(owned, held, matter, near, moved, coefficient, colour, stick, record, lost):
    """Stick history (owned, d) [m] and the tangential force t of every entry that presses, with its weights.

    moved (n, d) [m]: displacement in the step; held: not None where the history stays as it is. Weights exact for
    linear fields: w_j [1 + b . (x_j - xm)]. Sets lost (owned,), what is dissipated; returns the stick energy [J].
    """
    d, stored, w = matter.place.shape[1], 0.0, np.zeros((12, 3))
    for a in range(owned):
        rigidity, record[a, 2:], lost[a] = matter.constants[a, 2], 0.0, 0.0
        if not (record[a, 0] > 0.0 and coefficient[a] > 0.0):
            lost[a] = matter.share[a] * let_go(matter, near, a, held, moved, colour[a], stick[a], record[a], w)
            continue
        weight = matter.constants[a, 4] / colour[a]
        length = moments(matter, near, a, weight, w)
        if held is None:
            slip(matter, near, a, weight, moved, w)
            most = coefficient[a] * record[a, 0] * length * matter.constants[a, 4] * matter.constants[a, 3]
            lost[a] = matter.share[a] * slide(d, w[0], w[4], stick[a], w[5], rigidity, most)
        record[a, 2] = 1.0 / colour[a]
        for i in range(d):
            stored += 0.5 * matter.share[a] * rigidity * stick[a, i] * stick[a, i]
            record[a, 3 + i] = -rigidity * stick[a, i]
            record[a, 3 + d + i] = w[2, i]
            record[a, 3 + 2 * d + i] = matter.place[a, i] + w[1, i]
    return stored
