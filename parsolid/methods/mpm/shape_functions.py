"""Shape functions of the background grid, along one axis.

Nodes lie at origin + k h. A particle's stencil is the K consecutive nodes of each axis that its shape functions may
reach; the first of them is its base node, and the particles with one base node form a cell. With
xi = (x - origin)/h - base and node k = 0..K-1:

    Linear           w_k = N(xi - k), N the hat function
    UniformGimp      w_k = mean of N over the interval xi +- l, l the half width of the particle over h, at most 1/2
    QuadraticSpline  w_k = centred B-spline of degree 2
    CubicSpline      w_k = centred B-spline of degree 3

Bardenhagen and Kober, CMES 5 (2004) 477, for GIMP; Steffen, Kirby and Berzins, IJNME 76 (2008) 922, for the splines.
"""

from typing import NamedTuple

import numpy as np

from parsolid.materials.law_functions import law_function


class Linear(NamedTuple):
    """Hat functions. A cell starts `offset` spacings beyond its base node."""

    offset: float = 0.0


class UniformGimp(NamedTuple):
    """Hat functions averaged over a particle's undeformed domain.

    half_widths (capacity, 4): of the particles' domains over the grid spacing, above 0 and at most 1/2.
    """

    half_widths: np.ndarray
    offset: float = 0.5


class QuadraticSpline(NamedTuple):
    """B-splines of degree 2."""

    offset: float = 0.5


class CubicSpline(NamedTuple):
    """B-splines of degree 3."""

    offset: float = 1.0


def make_basis(name: str, half_widths: np.ndarray | None = None):
    """The basis that a scene names; half_widths: of `UniformGimp`."""
    if name == "ugimp":
        assert half_widths is not None
        return UniformGimp(half_widths)
    return {"linear": Linear, "quadratic-spline": QuadraticSpline, "cubic-spline": CubicSpline}[name]()


@law_function
def nodes_across(basis):
    """K, the nodes of a stencil along one axis."""


nodes_across.of(Linear)(lambda basis: 2)
nodes_across.of(UniformGimp, QuadraticSpline)(lambda basis: 3)
nodes_across.of(CubicSpline)(lambda basis: 4)


@law_function
def shape_functions(basis, p, axis, xi):
    """w_k and dw_k/dxi of particle p along an axis, two tuples of K numbers."""


@shape_functions.of(Linear)
def _hat(basis, p, axis, xi):
    return (1.0 - xi, xi), (-1.0, 1.0)


@shape_functions.of(UniformGimp)
def _averaged_hat(basis, p, axis, xi):
    half = basis.half_widths[p, axis]
    scale = 0.5 / half
    # ends of the domain as seen from the middle node, which it may straddle
    low, high = xi - 1.0 - half, xi - 1.0 + half
    a, b = min(low, 0.0), min(high, 0.0)
    c, d = max(low, 0.0), max(high, 0.0)
    before, after = scale * (a - b), scale * (d - c)
    first, last = 0.5 * before * (a + b), 0.5 * after * (d + c)
    return (first, 1.0 - first - last, last), (before, -(before + after), after)


@shape_functions.of(QuadraticSpline)
def _quadratic(basis, p, axis, xi):
    left, middle, right = 1.5 - xi, xi - 1.0, xi - 0.5
    return (0.5 * left * left, 0.75 - middle * middle, 0.5 * right * right), (-left, -2.0 * middle, right)


@shape_functions.of(CubicSpline)
def _cubic(basis, p, axis, xi):
    # t is the place in the middle cell
    t, s = xi - 1.0, 2.0 - xi
    tt, ss, third = 0.5 * t * t, 0.5 * s * s, 1.0 / 3.0
    w = (third * ss * s, tt * (t - 2.0) + 2.0 * third, ss * (s - 2.0) + 2.0 * third, third * tt * t)
    return w, (-ss, 3.0 * tt - 2.0 * t, 2.0 * s - 3.0 * ss, tt)


@law_function
def put_moments(basis, table):
    """Weights u_k of the slope sum_k u_k v_k of nodal velocities v into column 3 of table (K, 4), whose others are w_k,
    dw_k/dxi and the distance k - xi (Jiang et al., ACM Trans. Graph. 34 (2015) 51, eq. 8).

    u_k = w_k (k - xi)/D with D = sum_k w_k (k - xi)^2. D of hat functions vanishes at a node; u_k is dw_k/dxi for them.
    """


@put_moments.of(Linear)
def _hat_moments(basis, table):
    for k in range(2):
        table[k, 3] = table[k, 1]


@put_moments.of(UniformGimp, QuadraticSpline, CubicSpline)
def _smooth_moments(basis, table):
    spread = 0.0
    for k in range(nodes_across(basis)):
        table[k, 3] = table[k, 0] * table[k, 2]
        spread += table[k, 3] * table[k, 2]
    for k in range(nodes_across(basis)):
        table[k, 3] *= 1.0 / spread
