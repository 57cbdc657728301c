"""exp, log and powers as polynomials: loops that call them are vectorised, which the C library's prevent.

Within 3 units in the last place for arguments whose results are normal numbers. In plain Python they are those of
`math`.
"""

import math

import numpy as np
from numba.extending import overload

from parsolid.kernels import SCALAR_OPTIONS, scalar

_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
# adding it rounds a double to the next integer, which then stands in its lowest bits
_ROUND = 6755399441055744.0


def exp(x):
    """e^x; below -708 it is that of -708, above 709 that of 709."""
    return math.exp(min(max(x, -708.0), 709.0))


@overload(exp, jit_options=SCALAR_OPTIONS)
def _exp(x):
    def polynomial(x):
        bounded = min(max(x, -708.0), 709.0)
        shifted = bounded * _LOG2_E + _ROUND
        k = shifted - _ROUND
        r = (bounded - k * _LN2_HIGH) - k * _LN2_LOW
        p = 1.0 / 479001600.0
        p = p * r + 1.0 / 39916800.0
        p = p * r + 1.0 / 3628800.0
        p = p * r + 1.0 / 362880.0
        p = p * r + 1.0 / 40320.0
        p = p * r + 1.0 / 5040.0
        p = p * r + 1.0 / 720.0
        p = p * r + 1.0 / 120.0
        p = p * r + 1.0 / 24.0
        p = p * r + 1.0 / 6.0
        p = p * r + 0.5
        p = p * r + 1.0
        p = p * r + 1.0
        return np.int64(np.float64(p).view(np.int64) + (np.float64(shifted).view(np.int64) << 52)).view(np.float64)

    return polynomial


def log(x):
    """Natural logarithm of a positive number."""
    return math.log(x)


@overload(log, jit_options=SCALAR_OPTIONS)
def _log(x):
    def polynomial(x):
        bits = np.float64(x).view(np.int64)
        exponent = (bits - np.int64(0x3FE6A09E667F3BCD)) >> 52
        f = np.int64(bits - (exponent << 52)).view(np.float64) - 1.0
        k = np.int64(exponent + np.int64(0x4338000000000000)).view(np.float64) - _ROUND
        s = f / (2.0 + f)
        z = s * s
        p = 2.0 / 21.0
        p = p * z + 2.0 / 19.0
        p = p * z + 2.0 / 17.0
        p = p * z + 2.0 / 15.0
        p = p * z + 2.0 / 13.0
        p = p * z + 2.0 / 11.0
        p = p * z + 2.0 / 9.0
        p = p * z + 2.0 / 7.0
        p = p * z + 2.0 / 5.0
        p = p * z + 2.0 / 3.0
        return k * _LN2_HIGH + (k * _LN2_LOW + (s * (p * z) + 2.0 * s))

    return polynomial


@scalar
def power(base, exponent):
    """base^exponent of a base that is not negative; below 1e-300 it counts as that."""
    return exp(exponent * log(max(base, 1e-300)))
