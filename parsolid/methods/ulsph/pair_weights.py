"""Weights of pairs: those of the kernel at their present distances, and those that pairs in tension keep.

In tension, weights that fall as a pair stretches make neighbours part (Swegle, Hicks and Attaway, J. Comput. Phys. 116,
1995). A pair whose particles both pull keeps the weight of its reference distance. Rows of tension hold, with P the
symmetric part of sigma B/rho^2 and pull = 1 where r.P r may be positive, else 0:
    space [P_11 P_22 P_33 2P_12 | 2P_13 2P_23 pull .]; plane [P_11 P_22 2P_12 pull]
P is that of the record in the rates, and in the forces the mean of the record that these rates had and of the present
one: the mean of the kicks before and after a step then has the weights of its rates, and power closes to second order.
"""

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.pairs.rows_of_four import add, dot, load_row, scale, store_row, subtract
from parsolid.pairs.smoothing.gradient import gradient_factor


@kernel
def weigh(smoothing, d, squares, lengths, weights):
    """Fill weights with k_ab [1/m^(d + 2)] at squared distances [m^2] and smoothing lengths [m]; all (pairs,)."""
    for k in range(weights.size):
        inverse = 1.0 / lengths[k]
        factor = gradient_factor(smoothing, squares[k] ** 0.5 * inverse, d)
        weights[k] = -factor * inverse**4 * (inverse if d == 3 else 1.0)


@kernel
def reference_weights(smoothing, pairs, places, length, weights):
    """Weights of pairs of places (rows, d) [m] and smoothing lengths (rows,) [m]."""
    d, lengths = places.shape[1], np.empty(weights.size)
    for a in range(pairs[0].shape[0] - 1):
        for k in range(pairs[0][a], pairs[0][a + 1]):
            b, weights[k] = pairs[1][k], 0.0
            for c in range(d):
                weights[k] += (places[b, c] - places[a, c]) ** 2
            lengths[k] = 0.5 * (length[a] + length[b])
    weigh(smoothing, d, weights, lengths, weights)


@inlined
def whole_vectors(n):
    """n, rounded up to whole vectors of eight numbers."""
    return (n + 7) // 8 * 8


@kernel
def room_for_pairs(start):
    """Ones (3, n) for the squared distances, smoothing lengths and weights of the pairs of one particle; n: the most
    pairs of a particle, in whole vectors."""
    most = 0
    for a in range(start.shape[0] - 1):
        most = max(most, np.int64(start[a + 1]) - np.int64(start[a]))
    return np.ones((3, whole_vectors(most)))


@kernel
def weigh_in_space(smoothing, a, first, last, neighbour, motion, room):
    """Weights of pairs first..last-1, of particle a, in the last row of `room_for_pairs`. They are found before the
    sums, so that LLVM vectorises the loop."""
    x_a = load_row(motion, a, 4)
    for k in range(first, last):
        x_b = load_row(motion, neighbour[k], 4)
        r = subtract(x_b, x_a)
        room[0, k - first], room[1, k - first] = dot(r, r), 0.5 * (x_a[3] + x_b[3])
    n = whole_vectors(last - first)
    weigh(smoothing, 3, room[0, :n], room[1, :n], room[2, :n])


@kernel
def weigh_in_plane(smoothing, a, first, last, neighbour, motion, room):
    """As `weigh_in_space`."""
    for k in range(first, last):
        b = neighbour[k]
        x, y = motion[b, 2] - motion[a, 2], motion[b, 3] - motion[a, 3]
        room[0, k - first], room[1, k - first] = x * x + y * y, 0.5 * (motion[a, 5] + motion[b, 5])
    n = whole_vectors(last - first)
    weigh(smoothing, 2, room[0, :n], room[1, :n], room[2, :n])


@inlined
def held_weight(smoothing, weight, reference, h, square, pull_a, pull_b):
    """Weight of a stretched pair: between that of its present and that of its reference distance, the nearer to the
    latter the more equal pull_a and pull_b are, r.P r of both particles. In the last fifth of the support the kept
    weight falls to 0."""
    if min(pull_a, pull_b) > 0.0:
        share = 2.0 * min(pull_a, pull_b) / (pull_a + pull_b)
        distance = square**0.5 / (smoothing.support * h)
        weight += share * max(min(5.0 * (1.0 - distance), 1.0) * reference - weight, 0.0)
    return weight


@inlined
def pull_in_space(tension, a, r):
    """r.P_a r."""
    P, Q = load_row(tension, a, 0), load_row(tension, a, 4)
    pull = r[0] * (P[0] * r[0] + P[3] * r[1] + Q[0] * r[2])
    return pull + r[1] * (P[1] * r[1] + Q[1] * r[2]) + P[2] * r[2] * r[2]


@inlined
def pull_in_plane(tension, a, x, y):
    """r.P_a r of r = (x, y)."""
    P = load_row(tension, a, 0)
    return x * (P[0] * x + P[2] * y) + P[1] * y * y


@kernel
def find_tension_in_space(first, last, mean, record, tension):
    """Tension of rows first..last-1 from the record; mean: the mean of that and of what the rows held."""
    for a in range(first, last):
        u, v, w = load_row(record, a, 0), load_row(record, a, 4), load_row(record, a, 8)
        P, Q = (u[0], v[1], w[2], u[1] + v[0]), (u[2] + w[0], v[2] + w[1], 0.0, 0.0)
        if mean:
            P, Q = scale(0.5, add(load_row(tension, a, 0), P)), scale(0.5, add(load_row(tension, a, 4), Q))
        # the largest eigenvalue is tr P/3 + (2/3)^1/2 |dev P| at most
        p = (P[0] + P[1] + P[2]) / 3.0
        square = (P[0] - p) ** 2 + (P[1] - p) ** 2 + (P[2] - p) ** 2
        square += 0.5 * (P[3] * P[3] + Q[0] * Q[0] + Q[1] * Q[1])
        pull = 1.0 if p > 0.0 or 2.0 * square > 3.0 * p * p else 0.0
        store_row(tension, a, 0, P)
        store_row(tension, a, 4, (Q[0], Q[1], pull, 0.0))


@kernel
def find_tension_in_plane(first, last, mean, record, tension):
    """As `find_tension_in_space`."""
    for a in range(first, last):
        P = (record[a, 0], record[a, 3], record[a, 1] + record[a, 2], 0.0)
        if mean:
            P = scale(0.5, add(load_row(tension, a, 0), P))
        p, half = 0.5 * (P[0] + P[1]), 0.5 * (P[0] - P[1])
        pull = 1.0 if p > 0.0 or half * half + 0.25 * P[2] * P[2] > p * p else 0.0
        store_row(tension, a, 0, (P[0], P[1], P[2], pull))
