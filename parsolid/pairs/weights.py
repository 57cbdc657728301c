"""Set-up of the pair engine: pairs within the kernel's support, their weights g_ab, corrections L_a and jump factors
k_ab.

Metrics are (m, 6) rows (11, 22, 33, 12, 13, 23) of M = h^{-2}, with m = 1 when every particle has the same; a pair uses
the mean of both particles' metrics (of an image R M R), so that g_ab = -g_ba. In plane strain M33 = 1 and the other
out-of-plane terms are 0.
"""

import math
from typing import Any

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.pairs.lists import mutual
from parsolid.pairs.smoothing.gradient import gradient_factor


@register_jitable
def _pair_metric(metric, a, b, R):
    """Mean of M_a and R M_b R."""
    last = metric.shape[0] - 1
    i, j = min(a, last), min(b, last)
    return (
        0.5 * (metric[i, 0] + metric[j, 0]),
        0.5 * (metric[i, 1] + metric[j, 1]),
        0.5 * (metric[i, 2] + metric[j, 2]),
        0.5 * (metric[i, 3] + R[0] * R[1] * metric[j, 3]),
        0.5 * (metric[i, 4] + R[0] * R[2] * metric[j, 4]),
        0.5 * (metric[i, 5] + R[1] * R[2] * metric[j, 5]),
    )


@register_jitable
def _product(M, x):
    return (
        M[0] * x[0] + M[3] * x[1] + M[4] * x[2],
        M[3] * x[0] + M[1] * x[1] + M[5] * x[2],
        M[4] * x[0] + M[5] * x[1] + M[2] * x[2],
    )


@register_jitable
def _determinant(M):
    return M[0] * (M[1] * M[2] - M[5] * M[5]) - M[3] * (M[3] * M[2] - M[4] * M[5]) + M[4] * (M[3] * M[5] - M[4] * M[1])


@register_jitable
def point(positions, a):
    """X_a, with a third component of 0 in the plane."""
    if positions.shape[1] == 2:
        return positions[a, 0], positions[a, 1], 0.0
    return positions[a, 0], positions[a, 1], positions[a, 2]


@register_jitable
def image_point(positions, b, reflection, shift):
    X = point(positions, b)
    return (
        reflection[0] * X[0] + shift[0],
        reflection[1] * X[1] + shift[1],
        reflection[2] * X[2] + shift[2],
    )


@compiled
def distance_in_support(positions, metric, a, b, reflection, shift):
    """q of particle a and particle b, or b's image R X_b + T; reflection and shift are (3,)."""
    Xa, Xb = point(positions, a), image_point(positions, b, reflection, shift)
    x = (Xa[0] - Xb[0], Xa[1] - Xb[1], Xa[2] - Xb[2])
    Mx = _product(_pair_metric(metric, a, b, reflection), x)
    return math.sqrt(x[0] * Mx[0] + x[1] * Mx[1] + x[2] * Mx[2])


@compiled
def select_pairs(start, neighbour, positions, metric, support, first, last, code, reflections, shifts):
    """Keep candidates with q < support and first <= neighbour < last.

    code (m,) int8 picks each candidate's row of reflections, shifts (codes, 3). Returns (start, neighbour, code,
    coincident) with `coincident` the first candidate of two particles at the same place, or -1.
    """
    count = np.zeros(start.shape[0], np.int64)
    coincident = -1
    for a in range(start.shape[0] - 1):
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            if first <= b < last:
                q = distance_in_support(positions, metric, a, b, reflections[code[k]], shifts[code[k]])
                if q < support:
                    count[a + 1] += 1
                if q < 1e-9 and a != b:
                    coincident = k
    for a in range(start.shape[0] - 1):
        count[a + 1] += count[a]
    chosen = np.empty(count[-1], np.int32)
    codes = np.empty(count[-1], np.int8)
    position = 0
    for a in range(start.shape[0] - 1):
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            R, T = reflections[code[k]], shifts[code[k]]
            if first <= b < last and distance_in_support(positions, metric, a, b, R, T) < support:
                chosen[position] = b
                codes[position] = code[k]
                position += 1
    return count, chosen, codes, coincident


@compiled
def pair_weights(kernel, pairs, places, positions, metric, volume):
    """Fill g_ab = V_a V_b grad_a W(X_a - X_b) [m^5 in space, m^3 in the plane] into the weights' first columns."""
    dimension = positions.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        Xa = point(positions, a)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], places.code[k]
            Xb = image_point(positions, b, places.reflections[code], places.shifts[code])
            x = (Xa[0] - Xb[0], Xa[1] - Xb[1], Xa[2] - Xb[2])
            M = _pair_metric(metric, a, b, places.reflections[code])
            Mx = _product(M, x)
            q = math.sqrt(x[0] * Mx[0] + x[1] * Mx[1] + x[2] * Mx[2])
            factor = volume[a] * volume[b] * math.sqrt(_determinant(M)) * gradient_factor(kernel, q, dimension)
            for i in range(dimension):
                pairs.weight[k, i] = factor * Mx[i]


@compiled
def add_moments(pairs, places, positions, moment):
    """Add sum_b g_ab (x) (X_b - X_a) to moment (n, d, d) of the particles that receive."""
    d = positions.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        Xa = point(positions, a)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], places.code[k]
            Xb = image_point(positions, b, places.reflections[code], places.shifts[code])
            for i in range(d):
                for j in range(d):
                    term = pairs.weight[k, i] * (Xb[j] - Xa[j])
                    moment[a, i, j] += term
                    if mutual(pairs):
                        moment[b, i, j] += term


@compiled
def jump_factors(factor, pairs, places, correction):
    """Fill k_ab = factor/2 |C_skew| / |g|, C_skew = (L_a + L_b) g (eq (75)), beside g; correction is (n, d, d).

    The image of a neighbour has R L_b R.
    """
    d, weight = correction.shape[1], pairs.weight
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            R = places.reflections[places.code[k]]
            skew, length = 0.0, 0.0
            for i in range(d):
                component = 0.0
                for j in range(d):
                    component += (correction[a, i, j] + R[i] * R[j] * correction[b, i, j]) * weight[k, j]
                skew += component * component
                length += weight[k, i] * weight[k, i]
            weight[k, d] = 0.5 * factor * math.sqrt(skew / length) if length > 0.0 else 0.0


class PairWeights:
    """What a `PairSystem` asks of every kind of weights beside `empty`, `fill` and `complete`."""

    def kept(
        self, system: Any, start: np.ndarray, neighbour: np.ndarray, code: np.ndarray, *places: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(start, neighbour, code) of the pairs within the support that have a weight; places: reflections, shifts."""
        return start, neighbour, code
