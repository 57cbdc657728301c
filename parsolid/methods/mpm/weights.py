"""Weights of a particle on the background grid, by type of basis.

Nodes lie at origin + k h. A particle's stencil is the K consecutive nodes of each direction that its weights may reach;
the first of them is its base node, and the particles with one base node form a base cell. All three directions are
worked out at once, one in each lane. With xi = (x - origin)/h - base and node i = 0..K-1:

    Linear           w_i = N(xi - i), N the hat function
    UniformGimp      w_i = mean of N over the interval xi +- l, l the half width of the particle over h, at most 1/2
    ConvectedGimp    the same with l stretched with the particle, at most 1
    QuadraticSpline  w_i = centred B-spline of degree 2;   CubicSpline  of degree 3

Bardenhagen and Kober, CMES 5 (2004) 477, for the GIMP weights; Steffen, Kirby and Berzins, IJNME 76 (2008) 922, for the
splines.
"""

from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import constant, generic
from parsolid.numerics.lanes import broadcast, fused, load, store


class Linear(NamedTuple):
    """Hat functions: 2 nodes a direction."""

    nodes: int = 2


class UniformGimp(NamedTuple):
    """Hat functions averaged over a particle's undeformed domain: 3 nodes a direction.

    halves: (capacity, 4) half widths of the particles' domains over the grid spacing, above 0 and at most 1/2; fourth
    column 1/2.
    """

    halves: np.ndarray
    nodes: int = 3


class ConvectedGimp(NamedTuple):
    """Hat functions averaged over a particle's stretched domain: 4 nodes a direction.

    halves: (capacity, 4) current half widths over the grid spacing, above 0; those above 1 count as 1, which keeps the
    partition of unity. Fourth column 1/2.
    """

    halves: np.ndarray
    nodes: int = 4


class QuadraticSpline(NamedTuple):
    """Quadratic B-splines: 3 nodes a direction."""

    nodes: int = 3


class CubicSpline(NamedTuple):
    """Cubic B-splines: 4 nodes a direction."""

    nodes: int = 4


@constant
def nodes_across(basis) -> int:
    """K, the nodes of a stencil along one direction; a constant in compiled code."""
    return type(basis)._field_defaults["nodes"]


def make_basis(kind: str, halves: np.ndarray | None = None):
    """The basis that a scene names, on the particles' half widths `halves` where it needs them."""
    if kind in _AVERAGED:
        return _AVERAGED[kind](halves)
    return _PLAIN[kind]()


_PLAIN = {"linear": Linear, "quadratic-spline": QuadraticSpline, "cubic-spline": CubicSpline}
_AVERAGED = {"ugimp": UniformGimp, "cpgimp": ConvectedGimp}


# a base cell starts so much beyond its base node, in grid spacings
_OFFSETS = {Linear: 0.0, UniformGimp: 0.5, ConvectedGimp: 1.0, QuadraticSpline: 0.5, CubicSpline: 1.0}


@constant
def base_offset(basis) -> float:
    """Where a base cell starts: base node = floor((x - origin)/h - offset)."""
    return _OFFSETS[type(basis)]


@compiled
def find_bases(first, last, where, origin, inverse_spacing, offset, base):
    """Base nodes of particles first..last-1, base[p, d] = floor((x_d - origin_d)/h - offset).

    where (capacity, >= 3): positions [m] in the first columns; origin (4,) [m]; base (capacity, dimension) of any
    integer type.
    """
    for p in range(first, last):
        for d in range(base.shape[1]):
            base[p, d] = np.floor((where[p, d] - origin[d]) * inverse_spacing - offset)


@generic
def store_weights(basis, p, xi, weights):
    """Weights and their derivatives with respect to xi of particle p into weights (K, 16).

    xi: Lanes, position less base node in grid spacings. Columns 0..2 of row i: w_i along x, y, z; 4..6: dw_i/dxi.
    """


@store_weights.of(Linear)
def _linear(basis, p, xi, weights):
    store(weights, 0, 0, 1.0 - xi)
    store(weights, 1, 0, xi)
    store(weights, 0, 4, broadcast(-1.0))
    store(weights, 1, 4, broadcast(1.0))


@store_weights.of(UniformGimp)
def _uniform_gimp(basis, p, xi, weights):
    half = load(basis.halves, p, 0)
    scale = 0.5 / half
    # the domain's ends as seen from the middle node, which it may straddle
    low, high = xi - 1.0 - half, xi - 1.0 + half
    a, b = min(low, 0.0), min(high, 0.0)
    c, d = max(low, 0.0), max(high, 0.0)
    before, after = scale * (a - b), scale * (d - c)
    w0, w2 = 0.5 * before * (a + b), 0.5 * after * (d + c)
    store(weights, 0, 0, w0)
    store(weights, 1, 0, 1.0 - w0 - w2)
    store(weights, 2, 0, w2)
    store(weights, 0, 4, before)
    store(weights, 1, 4, -(before + after))
    store(weights, 2, 4, after)


@store_weights.of(ConvectedGimp)
def _convected_gimp(basis, p, xi, weights):
    half = min(load(basis.halves, p, 0), 1.0)
    scale = 0.5 / half
    low, high = xi - 1.0 - half, xi - 1.0 + half
    # parts of the domain before, within and after the particle's cell: ends, shares of the domain
    a, d = min(low, 0.0), max(high, 1.0) - 1.0
    b, c = max(low, 0.0), min(high, 1.0)
    before, within, after = -scale * a, scale * (c - b), scale * d
    middle = 0.5 * (b + c)
    store(weights, 0, 0, -0.5 * a * before)
    store(weights, 1, 0, fused(1.0 + 0.5 * a, before, (1.0 - middle) * within))
    store(weights, 2, 0, fused(1.0 - 0.5 * d, after, middle * within))
    store(weights, 3, 0, 0.5 * d * after)
    store(weights, 0, 4, -before)
    store(weights, 1, 4, before - within)
    store(weights, 2, 4, within - after)
    store(weights, 3, 4, after)


@store_weights.of(QuadraticSpline)
def _quadratic_spline(basis, p, xi, weights):
    left, middle, right = 1.5 - xi, xi - 1.0, xi - 0.5
    store(weights, 0, 0, 0.5 * left * left)
    store(weights, 1, 0, 0.75 - middle * middle)
    store(weights, 2, 0, 0.5 * right * right)
    store(weights, 0, 4, -left)
    store(weights, 1, 4, -2.0 * middle)
    store(weights, 2, 4, right)


@store_weights.of(CubicSpline)
def _cubic_spline(basis, p, xi, weights):
    # with t the place in the middle cell and s = 1 - t
    t, s = xi - 1.0, 2.0 - xi
    tt, ss = 0.5 * t * t, 0.5 * s * s
    third = 1.0 / 3.0
    store(weights, 0, 0, third * ss * s)
    store(weights, 1, 0, fused(tt, t - 2.0, broadcast(2.0 * third)))
    store(weights, 2, 0, fused(ss, s - 2.0, broadcast(2.0 * third)))
    store(weights, 3, 0, third * tt * t)
    store(weights, 0, 4, -ss)
    store(weights, 1, 4, fused(t, -2.0, 3.0 * tt))
    store(weights, 2, 4, fused(s, 2.0, -3.0 * ss))
    store(weights, 3, 4, tt)


@generic
def store_distances(basis, xi, weights):
    """What the affine transfer needs beside the weights, which must be there: node distances and moment weights.

    Columns 8..10 of row i: i - xi; 12..14: u_i = w_i (i - xi)/D with D = sum_i w_i (i - xi)^2, so that sum_i u_i v_i is
    the slope of the nodal velocities (Jiang et al., ACM Trans. Graph. 34 (2015) 51, eq 8). D vanishes at a node for hat
    functions, for which u_i is dw_i/dxi.
    """


@store_distances.of(Linear)
def _gradients(basis, xi, weights):
    for i in range(2):
        store(weights, i, 8, float(i) - xi)
        store(weights, i, 12, load(weights, i, 4))


@store_distances.otherwise
def _moments(basis, xi, weights):
    spread = broadcast(0.0)
    for i in range(nodes_across(basis)):
        distance = float(i) - xi
        first = load(weights, i, 0) * distance
        store(weights, i, 8, distance)
        store(weights, i, 12, first)
        spread = fused(first, distance, spread)
    scale = 1.0 / spread
    for i in range(nodes_across(basis)):
        store(weights, i, 12, scale * load(weights, i, 12))


@register_jitable
def store_derivatives(basis, weights):
    """As `store_distances` leaves them, dw_i/dxi for u_i in columns 12..14: the slope is the gradient (TPIC)."""
    for i in range(nodes_across(basis)):
        store(weights, i, 12, load(weights, i, 4))
