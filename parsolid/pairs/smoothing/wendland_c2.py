"""Wendland C2 (1 - q/2)^4 (2 q + 1), support 2 h."""

import math
from typing import NamedTuple

from parsolid.pairs.smoothing.gradient import gradient_factor


class WendlandC2(NamedTuple):
    """See the file's first line."""

    support: float = 2.0


KERNEL = WendlandC2()


@gradient_factor.of(WendlandC2)
def _gradient(kernel, q, dimension):
    c = 7.0 / (4.0 * math.pi) if dimension == 2 else 21.0 / (16.0 * math.pi)
    r = max(0.0, 1.0 - 0.5 * q)
    return -5.0 * c * r * r * r
