"""Kernels of ties: points on the face between two bodies, and weights of the particles around them.

place (n, d) [m]: reference positions of the particles of both bodies; volume (n,) [m^3]; other (n,): whether a particle
is of the second body. Neighbours of point p: rows[start[p]] .. rows[start[p + 1] - 1].
"""

import math

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.friction import combined, dot, linear_weights
from parsolid.contact.kernel import shape, slope
from parsolid.kernels import kernel

# bisections in the search for a face
_HALVINGS = 50


@register_jitable
def _away(place, b, point):
    """x_b - point [m] of a particle, zero beyond the dimension."""
    d = place.shape[1]
    y = place[b, 1] - point[1] if d > 1 else 0.0
    return place[b, 0] - point[0], y, place[b, 2] - point[2] if d > 2 else 0.0


@register_jitable
def _balance(point, near, rows, place, volume, other, inverse):
    """Colour of the second body less that of the first at a point, up to a factor; neighbours are rows[near]."""
    total = 0.0
    for k in range(near[0], near[1]):
        u = _away(place, rows[k], point)
        part = volume[rows[k]] * shape(math.sqrt(dot(u, u)) * inverse)
        total += part if other[rows[k]] else -part
    return total


@register_jitable
def _gradient(point, near, rows, place, volume, other, inverse):
    """Unit vector along the gradient of that difference at a point, and the length of the gradient, up to a factor."""
    n = (0.0, 0.0, 0.0)
    for k in range(near[0], near[1]):
        u = _away(place, rows[k], point)
        q = math.sqrt(dot(u, u)) * inverse
        if q > 0.0:
            n = combined(1.0, n, -volume[rows[k]] * slope(q) / q * (1.0 if other[rows[k]] else -1.0), u)
    length = max(math.sqrt(dot(n, n)), 1e-300)
    return (n[0] / length, n[1] / length, n[2] / length), length


@kernel
def faces(source, length, start, rows, place, volume, other, inverse, points):
    """Which particles `source` (m,) of the first body lie within a length [m] of the face to the second body, along the
    gradient of the difference of colours; the points where this line meets the face are put into points (m, d)."""
    d, found = place.shape[1], np.zeros(len(source), np.bool_)
    for m in range(len(source)):
        near, low, high = (start[m], start[m + 1]), -length, length
        x = _away(place, source[m], (0.0, 0.0, 0.0))
        n, steepness = _gradient(x, near, rows, place, volume, other, inverse)
        ends = combined(1.0, x, low, n), combined(1.0, x, high, n)
        before = _balance(ends[0], near, rows, place, volume, other, inverse)
        beyond = _balance(ends[1], near, rows, place, volume, other, inverse)
        found[m] = steepness > 1e-300 and before < 0.0 <= beyond
        for _ in range(_HALVINGS if found[m] else 0):
            middle = 0.5 * (low + high)
            if _balance(combined(1.0, x, middle, n), near, rows, place, volume, other, inverse) < 0.0:
                low = middle
            else:
                high = middle
        at = combined(1.0, x, 0.5 * (low + high), n)
        for i in range(d):
            points[m, i] = at[i]
    return found


@kernel
def weigh(points, start, rows, place, volume, inverse, sign, weight):
    """Weights of particles around points that reproduce linear fields there, times a sign, into weight (k,).

    w_j [1 + b . (x_j - x - mean)], w_j = V_j W_j/c, see `friction.linear_weights`. Returns the greatest distance [m] of
    the weighted sum of x_j from its point.
    """
    worst = 0.0
    for m in range(len(points)):
        total, mean = 0.0, (0.0, 0.0, 0.0)
        xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(start[m], start[m + 1]):
            u = _away(place, rows[k], points[m])
            w = weight[k] = volume[rows[k]] * shape(math.sqrt(dot(u, u)) * inverse)
            total, mean = total + w, combined(1.0, mean, w, u)
            xx, xy, xz = xx + w * u[0] * u[0], xy + w * u[0] * u[1], xz + w * u[0] * u[2]
            yy, yz, zz = yy + w * u[1] * u[1], yz + w * u[1] * u[2], zz + w * u[2] * u[2]
        over = 1.0 / max(total, 1e-300)
        mean = combined(over, mean, 0.0, mean)
        second = (over * xx, over * xy, over * xz, over * yy, over * yz, over * zz)
        tilt, missed = linear_weights(place.shape[1], mean, second), (0.0, 0.0, 0.0)
        for k in range(start[m], start[m + 1]):
            u = _away(place, rows[k], points[m])
            weight[k] *= sign * over * (1.0 + dot(tilt, combined(1.0, u, -1.0, mean)))
            missed = combined(1.0, missed, weight[k], u)
        worst = max(worst, max(abs(missed[0]), abs(missed[1]), abs(missed[2])) if start[m + 1] > start[m] else 1e300)
    return worst
