"""exp, log, erf and powers as polynomials: loops that call them are vectorised, which the C library's prevent.

Within 3 units in the last place for arguments whose results are normal numbers. In plain Python they are those of
`math`.
"""

import math

import numpy as np
from numba.extending import overload

from parsolid.kernels import INLINED, inlined

_LOG2_E = 1.4426950408889634
_LN2_HIGH, _LN2_LOW = 0.693147180369123816490, 1.90821492927058770002e-10
# adding it rounds a double to the next integer, which then stands in its lowest bits
_ROUND = 6755399441055744.0


def exp(x):
    """e^x; below -708 it is that of -708, above 709 that of 709."""
    return math.exp(min(max(x, -708.0), 709.0))


@overload(exp, jit_options=INLINED)
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


@overload(log, jit_options=INLINED)
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


@inlined
def power(base, exponent):
    """base^exponent of a base that is not negative; below 1e-300 it counts as that."""
    return exp(exponent * log(max(base, 1e-300)))


def erf(x):
    """Error function, within 2e-15."""
    return math.erf(x)


@overload(erf, jit_options=INLINED)
def _erf(x):
    # erfc = t exp(-x^2 + p(t)), t = 2/(2 + x), with a Chebyshev fit p of ln(erfcx/t)
    def polynomial(x):
        size = abs(x)
        t = 2.0 / (2.0 + size)
        s = 2.0 * t - 1.0
        p = -1.3170890159654395e-08
        p = p * s + 2.9424591797302894e-08
        p = p * s + 7.994730326910215e-08
        p = p * s - 2.8731782395389213e-07
        p = p * s - 4.843594856212904e-08
        p = p * s + 1.2776231638850909e-06
        p = p * s - 1.3981105699631882e-06
        p = p * s - 2.955021623640918e-06
        p = p * s + 8.650697102649504e-06
        p = p * s + 1.3212469470181018e-07
        p = p * s - 3.0229583912262866e-05
        p = p * s + 3.175154783103258e-05
        p = p * s + 7.141422843203703e-05
        p = p * s - 0.00017430589430367344
        p = p * s - 9.37377440416954e-05
        p = p * s + 0.0006736795543793789
        p = p * s - 0.00014624652350646715
        p = p * s - 0.002345812609827025
        p = p * s + 0.001758933534014601
        p = p * s + 0.008824938564974466
        p = p * s - 0.009872689365492807
        p = p * s - 0.046895610231392174
        p = p * s + 0.04734330684187756
        p = p * s + 0.6726432239776575
        p = p * s - 0.6717940840566922
        value = 1.0 - t * exp(p - size * size)
        return value if x >= 0.0 else -value

    return polynomial
