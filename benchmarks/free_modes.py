"""Exact frequencies of free elastic bodies: rings and discs in plane strain, spheres, and boxes by a series.

Discs and rings: A. E. H. Love, A Treatise on the Mathematical Theory of Elasticity (1927), section 214, with Bessel
functions of both kinds; spheres: H. Lamb, Proc. London Math. Soc. 13 (1882) 189, in the form of A. C. Eringen and
E. S. Suhubi, Elastodynamics II (1975), section 8.13; boxes: W. M. Visscher, A. Migliori, T. M. Bell and R. A. Reinert,
J. Acoust. Soc. Am. 90 (1991) 2154. Frequencies are angular [1/s], ascending, each as often as there are modes.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import jv, jvp, spherical_jn, yv, yvp

# of the least speed over the size, between places where a sign is looked at
_STEP = 0.01
# Fourier orders and degrees of spherical harmonics that are looked at
_ORDERS = 8


class Solid(NamedTuple):
    """Young's modulus [Pa], Poisson's ratio, density [kg/m^3]."""

    youngs_modulus: float
    poissons_ratio: float
    density: float

    @property
    def moduli(self) -> tuple[float, float]:
        """Lame's first and the shear modulus [Pa]."""
        E, nu = self.youngs_modulus, self.poissons_ratio
        return E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 * E / (1.0 + nu)

    @property
    def speeds(self) -> tuple[float, float]:
        """Of pressure and of shear waves [m/s]."""
        lame, shear = self.moduli
        return ((lame + 2.0 * shear) / self.density) ** 0.5, (shear / self.density) ** 0.5


def ring_frequencies(solid: Solid, inner: float, outer: float, count: int) -> np.ndarray:
    """The lowest `count` of a free ring between two radii [m], or of a disc (inner = 0), in plane strain."""
    fast, slow = solid.speeds
    radii = [outer] if inner == 0.0 else [inner, outer]

    def tractions(w: float, n: int) -> np.ndarray:
        rows = []
        for r in radii:
            columns = []
            for value, slope in ((jv, jvp), (yv, yvp))[: len(radii)]:
                k, s = w / fast, w / slow
                p, q, dp, dq = value(n, k * r), value(n, s * r), k * slope(n, k * r), s * slope(n, s * r)
                second = -dp / r - (k * k - n * n / r**2) * p
                ratio = (fast / slow) ** 2 - 2.0
                columns += [
                    [-ratio * k * k * p + 2.0 * second, -2.0 * n * (dp / r - p / r**2)],
                    [2.0 * n * (dq / r - q / r**2), 2.0 * dq / r + (s * s - 2.0 * n * n / r**2) * q],
                ]
            rows.append(np.array(columns).T * r**2)
        return np.vstack(rows)

    def determinant(n: int) -> Callable[[float], float]:
        def of(w: float) -> float:
            matrix = tractions(w, n)
            return float(np.linalg.det(matrix / np.linalg.norm(matrix, axis=0)))

        return of

    return _lowest([(determinant(n), 1 if n == 0 else 2) for n in range(_ORDERS)], slow / outer, count)


def sphere_frequencies(solid: Solid, radius: float, count: int) -> np.ndarray:
    """The lowest `count` of a free sphere."""
    fast, slow = solid.speeds

    def torsional(degree: int) -> Callable[[float], float]:
        def of(w: float) -> float:
            x = w * radius / slow
            return float((degree - 1) * spherical_jn(degree, x) - x * spherical_jn(degree + 1, x))

        return of

    def spheroidal(degree: int) -> Callable[[float], float]:
        def of(w: float) -> float:
            a, b, m = w * radius / fast, w * radius / slow, degree
            ja, ja1, jb, jb1 = (spherical_jn(k, x) for x in (a, b) for k in (m, m + 1))
            first = (m * m - m - 0.5 * b * b) * ja + 2.0 * a * ja1
            second = m * (m + 1) * ((m - 1) * jb - b * jb1)
            third, fourth = (m - 1) * ja - a * ja1, (m * m - 1 - 0.5 * b * b) * jb + b * jb1
            return float(first if m == 0 else first * fourth - second * third)

        return of

    families = [(torsional(m), 2 * m + 1) for m in range(1, _ORDERS)]
    return _lowest([*families, *((spheroidal(m), 2 * m + 1) for m in range(_ORDERS))], slow / radius, count)


def _lowest(families: list[tuple[Callable[[float], float], int]], unit: float, count: int) -> np.ndarray:
    """The lowest zeros of functions with their multiplicities; unit [1/s]: in which zeros are apart."""
    found, w = list[float](), 0.5 * _STEP * unit
    # of degree 1 and order 1 the motion without deformation is a double zero at 0
    last = [function(w) for function, _ in families]
    while len(found) < count:
        for k, (function, multiplicity) in enumerate(families):
            value = function(w + _STEP * unit)
            if value * last[k] < 0.0:
                found += [float(brentq(function, w, w + _STEP * unit, xtol=1e-14 * unit))] * multiplicity
            last[k] = value
        w += _STEP * unit
    return np.array(sorted(found)[:count])


def box_frequencies(
    solid: Solid, sides: tuple[float, ...], count: int, clamped: int | None = None, degree: int = 11
) -> Any:
    """The lowest `count` of a box with some sides [m], in plane strain of two; free, or clamped at the lower end of an
    axis; by Ritz's method with products of Legendre's polynomials up to a total degree.

    Rigid modes of a free box are left out. Frequencies are upper bounds, of a free box good to 1e-6 and better, of a
    clamped one, whose stress is singular at corners, to some 1e-3.
    """
    d, (lame, shear) = len(sides), solid.moduli
    nodes, weights = np.polynomial.legendre.leggauss(degree + 2)
    values = np.polynomial.legendre.legvander(nodes, degree)
    slopes = np.stack([np.polynomial.legendre.Legendre.basis(k).deriv()(nodes) for k in range(degree + 1)], axis=1)
    of_axes = []
    for axis, side in enumerate(sides):
        v, s = values, slopes * 2.0 / side
        if axis == clamped:
            v, s = (1.0 + nodes)[:, None] * values, s * (1.0 + nodes)[:, None] + values * 2.0 / side
        scale = 0.5 * side * weights
        of_axes.append([[np.einsum("q,qa,qb->ab", scale, one, two) for two in (v, s)] for one in (v, s)])
    powers = np.array([p for p in np.ndindex(*(degree + 1,) * d) if sum(p) <= degree])

    def gram(i: int | None, j: int | None) -> np.ndarray:
        """Integrals of products of the i-th slopes and the j-th slopes, None for values."""
        result = np.ones((len(powers), len(powers)))
        for axis in range(d):
            result *= of_axes[axis][int(axis == i)][int(axis == j)][powers[:, axis][:, None], powers[:, axis]]
        return result

    squares = sum(gram(k, k) for k in range(d))
    stiffness = [
        [lame * gram(i, j) + shear * gram(j, i) + (i == j) * shear * squares for j in range(d)] for i in range(d)
    ]
    mass = np.kron(np.eye(d), solid.density * gram(None, None))
    rigid = 0 if clamped is not None else d * (d + 1) // 2
    found = eigh(np.block(stiffness), mass, eigvals_only=True, subset_by_index=(0, rigid + count - 1))
    return np.sqrt(np.maximum(found[rigid:], 0.0))
