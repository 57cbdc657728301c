"""Kernels of ties: points on the face between two bodies, weights of the particles around them, and forces.

place (n, d) [m]: reference positions of the particles of both bodies; volume (n,) [m^3]; other (n,): whether a particle
is of the second body. Neighbours of point p: rows[start[p]] .. rows[start[p + 1] - 1].
"""

import math
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.friction import linear_weights
from parsolid.contact.kernel import shape, slope
from parsolid.kernels import kernel

# bisections in the search for a face
_HALVINGS = 50


class Springs(NamedTuple):
    """Springs of points: particles rows[start[p]] .. rows[start[p + 1] - 1], their weights, negative for the first
    body, and stiffnesses (points,) [N/m]."""

    start: np.ndarray
    rows: np.ndarray
    weight: np.ndarray
    stiffness: np.ndarray


@register_jitable
def _balance(point, near, rows, place, volume, other, inverse):
    """Colour of the second body less that of the first at a point, up to a factor; neighbours are rows[near]."""
    total = 0.0
    for k in range(near[0], near[1]):
        b, square = rows[k], 0.0
        for i in range(place.shape[1]):
            square += (point[i] - place[b, i]) ** 2
        part = volume[b] * shape(math.sqrt(square) * inverse)
        total += part if other[b] else -part
    return total


@register_jitable
def _towards(a, near, rows, place, volume, other, inverse, n):
    """Unit vector n (d,) along the gradient of that difference at particle a; returns whether it is not zero."""
    n[:] = 0.0
    length = 0.0
    for k in range(near[0], near[1]):
        b, square = rows[k], 0.0
        for i in range(place.shape[1]):
            square += (place[a, i] - place[b, i]) ** 2
        q = math.sqrt(square) * inverse
        if q > 0.0:
            pull = volume[b] * slope(q) / q * (1.0 if other[b] else -1.0)
            for i in range(place.shape[1]):
                n[i] += pull * (place[a, i] - place[b, i])
    for i in range(place.shape[1]):
        length += n[i] * n[i]
    for i in range(place.shape[1]):
        n[i] /= max(math.sqrt(length), 1e-300)
    return length > 0.0


@kernel
def faces(source, length, start, rows, place, volume, other, inverse, points):
    """Which particles `source` (m,) of the first body lie within a length [m] of the face to the second body, along the
    gradient of the difference of colours; the points where this line meets the face are put into points (m, d)."""
    d = place.shape[1]
    found = np.zeros(len(source), np.bool_)
    n, point = np.empty(d), np.empty(d)
    for m in range(len(source)):
        a, near = source[m], (start[m], start[m + 1])
        if not _towards(a, near, rows, place, volume, other, inverse, n):
            continue
        low, high = -length, length
        for i in range(d):
            point[i] = place[a, i] + high * n[i]
        if _balance(point, near, rows, place, volume, other, inverse) < 0.0:
            continue
        for i in range(d):
            point[i] = place[a, i] + low * n[i]
        if _balance(point, near, rows, place, volume, other, inverse) >= 0.0:
            continue
        found[m] = True
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            for i in range(d):
                point[i] = place[a, i] + middle * n[i]
            if _balance(point, near, rows, place, volume, other, inverse) < 0.0:
                low = middle
            else:
                high = middle
        for i in range(d):
            points[m, i] = place[a, i] + 0.5 * (low + high) * n[i]
    return found


@kernel
def weigh(points, start, rows, place, volume, inverse, sign, weight):
    """Weights of particles around points that reproduce linear fields there, times a sign, into weight (k,).

    w_j [1 + b . (x_j - x - mean)], w_j = V_j W_j/c, see `friction.linear_weights`. Returns the greatest distance [m] of
    the weighted sum of x_j from its point.
    """
    d, worst, away, mean, second = place.shape[1], 0.0, np.zeros(3), np.zeros(3), np.zeros((3, 3))
    for m in range(len(points)):
        total, miss = 0.0, 0.0
        mean[:], second[:] = 0.0, 0.0
        for k in range(start[m], start[m + 1]):
            square = 0.0
            for i in range(d):
                away[i] = place[rows[k], i] - points[m, i]
                square += away[i] * away[i]
            weight[k] = volume[rows[k]] * shape(math.sqrt(square) * inverse)
            total += weight[k]
            for i in range(d):
                mean[i] += weight[k] * away[i]
                for j in range(d):
                    second[i, j] += weight[k] * away[i] * away[j]
        total = max(total, 1e-300)
        mean /= total
        second /= total
        upper = second[0, 0], second[0, 1], second[0, 2], second[1, 1], second[1, 2], second[2, 2]
        tilt = linear_weights(d, (mean[0], mean[1], mean[2]), upper)
        for k in range(start[m], start[m + 1]):
            part = 1.0
            for i in range(d):
                part += tilt[i] * (place[rows[k], i] - points[m, i] - mean[i])
            weight[k] *= part / total
        for i in range(d):
            got = 0.0
            for k in range(start[m], start[m + 1]):
                got += weight[k] * (place[rows[k], i] - points[m, i])
            miss = max(miss, abs(got))
        for k in range(start[m], start[m + 1]):
            weight[k] *= sign
        worst = max(worst, miss if start[m + 1] > start[m] else 1e300)
    return worst


@kernel
def pull(springs, counted, moved, owned, force):
    """Forces (owned, d) [N] of ties on owned particles by the displacements moved (n, d) [m] of all; returns the energy
    [J] of the springs that this rank counts.

    U = sum_p k_p |e_p|^2/2, e_p = sum_j w_pj u_j, the separation of the faces at p.
    """
    start, rows, weight, stiffness = springs
    d, energy, e = moved.shape[1], 0.0, np.empty(3)
    force[:] = 0.0
    for p in range(len(stiffness)):
        square = 0.0
        for i in range(d):
            e[i] = 0.0
        for k in range(start[p], start[p + 1]):
            for i in range(d):
                e[i] += weight[k] * moved[rows[k], i]
        for i in range(d):
            square += e[i] * e[i]
            e[i] *= stiffness[p]
        if counted[p]:
            energy += 0.5 * stiffness[p] * square
        for k in range(start[p], start[p + 1]):
            if rows[k] < owned:
                for i in range(d):
                    force[rows[k], i] -= weight[k] * e[i]
    return energy


@kernel
def frequency(springs, mass, owned):
    """Upper bound of the square of the frequency [1/s^2] of ties alone, by the row sums of M^-1 K (Gershgorin)."""
    start, rows, weight, stiffness = springs
    sums = np.zeros(owned)
    for p in range(len(stiffness)):
        total = 0.0
        for k in range(start[p], start[p + 1]):
            total += abs(weight[k])
        for k in range(start[p], start[p + 1]):
            if rows[k] < owned:
                sums[rows[k]] += stiffness[p] * abs(weight[k]) * total
    most = 0.0
    for a in range(owned):
        if mass[a] > 0.0:
            most = max(most, sums[a] / mass[a])
    return most
