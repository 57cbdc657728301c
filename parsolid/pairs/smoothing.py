"""Smoothing kernels W(q) = c sqrt(det M) f(q), q^2 = x . M x, with the metric M = h^{-2} along a particle's own axes.

Each kernel is a type; only the gradient is needed, grad W = c sqrt(det M) f'(q)/q M x.
"""

import math
from typing import NamedTuple

from numba.extending import overload

from parsolid.numerics.dispatch import is_instance


class WendlandC2(NamedTuple):
    """Wendland C2 (1 - q/2)^4 (2 q + 1), support 2 h."""

    support: float = 2.0


class CubicSpline(NamedTuple):
    """Cubic B-spline (Monaghan), support 2 h."""

    support: float = 2.0


class QuinticSpline(NamedTuple):
    """Quintic B-spline, support 3 h."""

    support: float = 3.0


KERNELS = {"wendland-c2": WendlandC2(), "cubic-spline": CubicSpline(), "quintic-spline": QuinticSpline()}


def gradient_factor(kernel, q, dimension):
    """c f'(q)/q; zero at q = 0 and outside the support."""
    raise NotImplementedError


@overload(gradient_factor)
def _gradient_factor(kernel, q, dimension):
    if is_instance(kernel, WendlandC2):

        def wendland(kernel, q, dimension):
            c = 7.0 / (4.0 * math.pi) if dimension == 2 else 21.0 / (16.0 * math.pi)
            r = max(0.0, 1.0 - 0.5 * q)
            return -5.0 * c * r * r * r

        return wendland
    if is_instance(kernel, CubicSpline):

        def cubic(kernel, q, dimension):
            c = 10.0 / (7.0 * math.pi) if dimension == 2 else 1.0 / math.pi
            if q < 1.0:
                return c * (2.25 * q - 3.0)
            r = max(0.0, 2.0 - q)
            return -0.75 * c * r * r / q

        return cubic

    def quintic(kernel, q, dimension):
        c = 7.0 / (478.0 * math.pi) if dimension == 2 else 1.0 / (120.0 * math.pi)
        if q == 0.0:
            return 0.0
        third, second, first = max(0.0, 3.0 - q), max(0.0, 2.0 - q), max(0.0, 1.0 - q)
        return -5.0 * c * (third**4 - 6.0 * second**4 + 15.0 * first**4) / q

    return quintic
