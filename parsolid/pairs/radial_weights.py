"""Weights w(|xi|) V_a V_b of radial pair lists, and the shape tensors that correct their gradients.

The horizon delta is a metric M = 1/delta^2 (see `weights`), so that q = |xi|/delta; a pair uses the mean of both
metrics. Positions are (n, d) with d = 2 or 3; a bar lies in the plane with second coordinate 0, its shape tensor has
K11 alone.
"""

from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.collective import raise_together
from parsolid.numerics.dispatch import generic
from parsolid.pairs.lists import mutual
from parsolid.pairs.weights import PairWeights, distance_in_support


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


@generic
def influence(kind, q):
    """w(q), at most 1."""


@influence.of(Constant)
def _constant_influence(kind, q):
    return 1.0


@influence.of(Linear)
def _linear_influence(kind, q):
    return 1.0 - q


@influence.of(CubicSpline)
def _cubic_influence(kind, q):
    if q < 0.5:
        return 1.0 - 6.0 * q * q * (1.0 - q)
    return 2.0 * (1.0 - q) * (1.0 - q) * (1.0 - q)


@compiled
def bond_weights(kind, pairs, places, positions, metric, volume):
    """Fill w(|xi|) V_a V_b [m^6 in space, m^4 in the plane] into the weights (m,)."""
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], places.code[k]
            q = distance_in_support(positions, metric, a, b, places.reflections[code], places.shifts[code])
            pairs.weight[k] = influence(kind, q) * volume[a] * volume[b]


@compiled
def add_shapes(chosen, pairs, places, positions, shape):
    """Add sum_b w V_a V_b xi (x) xi to shape (n, d, d) of the particles that receive: V_a K_a, of chosen (n,)
    particles."""
    d = positions.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, w = pairs.neighbour[k], pairs.weight[k]
            first, second = chosen[a], mutual(pairs) and chosen[b]
            if not (first or second):
                continue
            R, T = places.reflections[places.code[k]], places.shifts[places.code[k]]
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

    bar: only K11 counts. Where the bonds do not span space (det K below 1e-9 of the cube of its mean diagonal) the
    inverse is zero: such a particle carries no stress.
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


class RadialWeights(PairWeights):
    """Weights of an influence function; a broken bond has weight 0.

    Of owned particles: inverse_shape, initial_inverse_shape (owned, d, d), K^{-1} now and with all bonds whole;
    determinant (owned,) of K.
    """

    def __init__(self, influence, bar: bool = False):
        """influence: of `INFLUENCES`; bar: whether K11 alone counts."""
        self.influence, self.bar, self.support = influence, bar, influence.support

    def empty(self, pairs: int) -> np.ndarray:
        """Room for the weights of so many pairs."""
        return np.empty(pairs)

    def fill(self, system, pairs, places) -> None:
        """Weights of one list of a `PairSystem`."""
        bond_weights(self.influence, pairs, places, system.positions, system.metric, system.volume)

    def complete(self, system) -> np.ndarray:
        """K^{-1} (owned, d, d) when all lists are filled; SolverError on all ranks where bonds do not span space.
        Collective."""
        owned, d = system.owned, system.positions.shape[1]
        self.inverse_shape, self.determinant = np.zeros((owned, d, d)), np.zeros(owned)
        self.refresh(system)
        raise_together(system.comm, self._unsupported(system))
        self.initial_inverse_shape = self.inverse_shape.copy()
        return self.inverse_shape

    def refresh(self, system, particles: np.ndarray | None = None) -> None:
        """K and K^{-1} of owned particles (all unless given) on the surviving bonds; sums in an order that never
        changes."""
        n, d = system.positions.shape
        shape, chosen = np.zeros((n, d, d)), np.zeros(n, bool)
        chosen[slice(None) if particles is None else particles] = True
        for pairs, places in system.lists():
            add_shapes(chosen, pairs, places, system.positions, shape)
        invert_shapes(chosen, self.bar, system.owned, system.volume, shape, self.inverse_shape, self.determinant)

    def _unsupported(self, system) -> str | None:
        """Names the first particle whose bonds do not span space."""
        flat = ~self.inverse_shape.any(axis=(1, 2))
        if not flat.any():
            return None
        place = ", ".join(f"{x:.6g}" for x in system.positions[np.argmax(flat)])
        return f"method.horizon_ratio: expected bonds in every direction at every particle, found too few at ({place})"
