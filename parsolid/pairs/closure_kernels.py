"""Kernels of `pairs.closure`: discrete divergence of a constant, graph Laplacian of the pairs, new weights.

Pair weights are rows (g_ab, w_ab) here: the column that later holds the jump factor holds the pair's stiffness w_ab.
Corrections L are (n, d, d); the image of a neighbour has R L_b R.
"""

import math

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.pairs.lists import mutual


@register_jitable
def _flux(a, b, k, R, correction, weight, i):
    """Component i of (L_a + L_b) g_ab."""
    result = 0.0
    for j in range(correction.shape[1]):
        result += (correction[a, i, j] + R[i] * R[j] * correction[b, i, j]) * weight[k, j]
    return result


@compiled
def add_fluxes(pairs, places, correction, total):
    """Add sum_b (L_a + L_b) g_ab [m^2] to total (n, d): the pair force of a stress of 1 Pa everywhere."""
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            R = places.reflections[places.code[k]]
            for i in range(total.shape[1]):
                c = _flux(a, b, k, R, correction, pairs.weight, i)
                total[a, i] += c
                if mutual(pairs):
                    total[b, i] -= c


@compiled
def stiffen(pairs, places, positions, diagonal):
    """Fill w_ab = |g_ab| |X_b - X_a| beside g and add it to diagonal (n,) of the particles that receive."""
    d, weight = positions.shape[1], pairs.weight
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], places.code[k]
            squares, length = 0.0, 0.0
            for i in range(d):
                x = places.reflections[code, i] * positions[b, i] + places.shifts[code, i] - positions[a, i]
                length += x * x
                squares += weight[k, i] * weight[k, i]
            weight[k, d] = math.sqrt(squares * length)
            diagonal[a] += weight[k, d]
            if mutual(pairs):
                diagonal[b] += weight[k, d]


@compiled
def add_laplacian(pairs, places, potential, total):
    """Add sum_b w_ab (p_a - p_b) to total (n, d); the image of a neighbour has R p_b."""
    d = potential.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            for i in range(d):
                c = pairs.weight[k, d] * (potential[a, i] - places.reflections[places.code[k], i] * potential[b, i])
                total[a, i] += c
                if mutual(pairs):
                    total[b, i] -= c


@compiled
def add_potential(pairs, places, correction, potential):
    """Add to g_ab what changes (L_a + L_b) g_ab by about w_ab (p_a - p_b): exactly where L_a + L_b is a multiple of
    1."""
    d, weight = potential.shape[1], pairs.weight
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            trace = 0.0
            for i in range(d):
                trace += correction[a, i, i] + correction[b, i, i]
            for i in range(d):
                step = potential[a, i] - places.reflections[places.code[k], i] * potential[b, i]
                weight[k, i] += weight[k, d] * step * d / trace
