"""Quintic B-spline, support 3 h."""

import math
from typing import NamedTuple

from parsolid.pairs.smoothing.gradient import gradient_factor


class QuinticSpline(NamedTuple):
    """See the file's first line."""

    support: float = 3.0


KERNEL = QuinticSpline()


@gradient_factor.of(QuinticSpline)
def _gradient(kernel, q, dimension):
    c = 7.0 / (478.0 * math.pi) if dimension == 2 else 1.0 / (120.0 * math.pi)
    if q == 0.0:
        return 0.0
    third, second, first = max(0.0, 3.0 - q), max(0.0, 2.0 - q), max(0.0, 1.0 - q)
    return -5.0 * c * (third**4 - 6.0 * second**4 + 15.0 * first**4) / q
