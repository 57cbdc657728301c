"""Cubic B-spline (Monaghan), support 2 h."""

import math
from typing import NamedTuple

from parsolid.pairs.smoothing.gradient import gradient_factor


class CubicSpline(NamedTuple):
    """See the file's first line."""

    support: float = 2.0


KERNEL = CubicSpline()


@gradient_factor.of(CubicSpline)
def _gradient(kernel, q, dimension):
    c = 10.0 / (7.0 * math.pi) if dimension == 2 else 1.0 / math.pi
    if q < 1.0:
        return c * (2.25 * q - 3.0)
    r = max(0.0, 2.0 - q)
    return -0.75 * c * r * r / q
