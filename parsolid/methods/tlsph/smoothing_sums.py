"""Sums over pairs that a new reference is made of; slow and plain, for they are taken once an update."""

from decomposition.compiled import compiled
from parsolid.pairs.lists import mutual
from parsolid.pairs.weights import distance_in_support

# neighbours farther than this many spacings, squared, do not count: the 1-2-1 of a lattice ends at its cubes' corners
_FARTHEST = 3.5


@compiled
def add_differences(pairs, places, signs, values, sums):
    """Add sum_b (Q u_b - u_a) (x) g_ab to sums (n, d, d); values u (n, d), signs Q (codes, 3) of the images."""
    d = values.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], places.code[k]
            for i in range(d):
                step = signs[code, i] * values[b, i] - values[a, i]
                for j in range(d):
                    sums[a, i, j] += step * pairs.weight[k, j]
                    if mutual(pairs):
                        sums[b, i, j] += step * pairs.weight[k, j]


@compiled
def add_deviations(pairs, places, signs, positions, metric, smoothing, values, gradient, deviation, weight):
    """Add 2^(-s^2) times Q u_b - u_a - 1/2 (G_a + Q G_b R) (X_b - X_a) to deviation (n, d), and 2^(-s^2) to weight.

    s: the distance in spacings, smoothing (h over the spacing) times that of `pairs.weights`.
    """
    d = values.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], places.code[k]
            Q, R, T = signs[code], places.reflections[code], places.shifts[code]
            square = (smoothing * distance_in_support(positions, metric, a, b, R, T)) ** 2
            if square < _FARTHEST:
                w = 2.0**-square
                weight[a] += w
                if mutual(pairs):
                    weight[b] += w
                for i in range(d):
                    jump = Q[i] * values[b, i] - values[a, i]
                    for j in range(d):
                        step = R[j] * positions[b, j] + T[j] - positions[a, j]
                        jump -= 0.5 * (gradient[a, i, j] + Q[i] * R[j] * gradient[b, i, j]) * step
                    deviation[a, i] += w * jump
                    if mutual(pairs):
                        deviation[b, i] -= w * jump
