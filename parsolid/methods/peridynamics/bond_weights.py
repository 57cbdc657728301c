"""Set-up of radial pair lists: influence functions, weights w(|xi|) V_a V_b, shape tensors and their inverses.

The horizon delta is a metric M = 1/delta^2 (see `weights`), so that q = |xi|/delta; a pair uses the mean of both metrics.
Positions are (n, d) with d = 2 or 3; a bar lies in the plane with second coordinate 0, its shape tensor has K11 alone.
"""

from typing import NamedTuple

from numba.extending import overload, register_jitable

from decomposition.compiled import compiled
from parsolid.numerics.dispatch import is_instance
from parsolid.pairs.weights import distance_in_support


class Constant(NamedTuple):
    """w = 1."""

    support: float = 1.0


class Linear(NamedTuple):
    """w = 1 - q."""

    support: float = 1.0


class CubicSpline(NamedTuple):
    """w = 1 - 6 q^2 + 6 q^3 up to q = 1/2, then 2 (1 - q)^3."""

    support: float = 1.0


INFLUENCES = {"constant": Constant(), "linear": Linear(), "cubic-spline": CubicSpline()}


def influence(kind, q):
    """w(q), at most 1."""
    raise NotImplementedError


@overload(influence)
def _influence(kind, q):
    if is_instance(kind, Constant):
        return lambda kind, q: 1.0
    if is_instance(kind, Linear):
        return lambda kind, q: 1.0 - q
    if is_instance(kind, CubicSpline):

        def cubic(kind, q):
            if q < 0.5:
                return 1.0 - 6.0 * q * q * (1.0 - q)
            return 2.0 * (1.0 - q) * (1.0 - q) * (1.0 - q)

        return cubic


@compiled
def bond_weights(kind, start, neighbour, code, reflections, shifts, positions, metric, volume, weight):
    """Fill w(|xi|) V_a V_b [m^6 in space, m^4 in the plane] into weight (m,)."""
    for a in range(start.shape[0] - 1):
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            q = distance_in_support(positions, metric, a, b, reflections[code[k]], shifts[code[k]])
            weight[k] = influence(kind, q) * volume[a] * volume[b]


@compiled
def add_shapes(chosen, both, start, neighbour, code, reflections, shifts, positions, weight, shape):
    """Add sum_b w V_a V_b xi (x) xi to shape (n, d, d) of a, and of b where `both`: V_a K_a, of chosen (n,) particles."""
    d = positions.shape[1]
    for a in range(start.shape[0] - 1):
        for k in range(start[a], start[a + 1]):
            b, w = neighbour[k], weight[k]
            first, second = chosen[a], both and chosen[b]
            if not (first or second):
                continue
            R, T = reflections[code[k]], shifts[code[k]]
            for i in range(d):
                x = R[i] * positions[b, i] + T[i] - positions[a, i]
                for j in range(i + 1):
                    term = w * x * (R[j] * positions[b, j] + T[j] - positions[a, j])
                    if first:
                        shape[a, i, j] += term
                    if second:
                        shape[b, i, j] += term


@register_jitable
def _determinant(K):
    if K.shape[0] == 2:
        return K[0, 0] * K[1, 1] - K[1, 0] * K[1, 0]
    return (
        K[0, 0] * (K[1, 1] * K[2, 2] - K[2, 1] * K[2, 1])
        - K[1, 0] * (K[1, 0] * K[2, 2] - K[2, 0] * K[2, 1])
        + K[2, 0] * (K[1, 0] * K[2, 1] - K[2, 0] * K[1, 1])
    )


@register_jitable
def _invert(K, r, inverse):
    """Adjugate of a symmetric K, of which the lower triangle is read, times r."""
    if K.shape[0] == 2:
        inverse[0, 0], inverse[1, 1], inverse[1, 0] = K[1, 1] * r, K[0, 0] * r, -K[1, 0] * r
    else:
        inverse[0, 0] = (K[1, 1] * K[2, 2] - K[2, 1] * K[2, 1]) * r
        inverse[1, 1] = (K[0, 0] * K[2, 2] - K[2, 0] * K[2, 0]) * r
        inverse[2, 2] = (K[0, 0] * K[1, 1] - K[1, 0] * K[1, 0]) * r
        inverse[1, 0] = (K[2, 0] * K[2, 1] - K[1, 0] * K[2, 2]) * r
        inverse[2, 0] = (K[1, 0] * K[2, 1] - K[2, 0] * K[1, 1]) * r
        inverse[2, 1] = (K[1, 0] * K[2, 0] - K[2, 1] * K[0, 0]) * r


@compiled
def invert_shapes(chosen, bar, owned, volume, shape, inverse, determinant):
    """K_a^{-1} and det K_a of chosen owned particles from the lower triangles of V_a K_a.

    bar: only K11 counts. Where the bonds do not span space (det K below 1e-9 of the cube of its mean diagonal) the inverse
    is zero: such a particle carries no stress.
    """
    d = shape.shape[1]
    for a in range(owned):
        if not chosen[a]:
            continue
        inverse[a] = 0.0
        if bar:
            K = shape[a, 0, 0] / volume[a]
            determinant[a] = K
            if K > 0.0:
                inverse[a, 0, 0] = 1.0 / K
            continue
        mean = 0.0
        for i in range(d):
            mean += shape[a, i, i] / d
            for j in range(i + 1):
                shape[a, i, j] /= volume[a]
        mean /= volume[a]
        determinant[a] = _determinant(shape[a])
        if determinant[a] > 1e-9 * mean**d:
            _invert(shape[a], 1.0 / determinant[a], inverse[a])
            for i in range(d):
                for j in range(i):
                    inverse[a, j, i] = inverse[a, i, j]
