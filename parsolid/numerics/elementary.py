"""Choices and elementary functions, lane by lane: material laws that are written once run on floats and lanes.

exp and log are polynomials in LLVM vector instructions, within 2 units in the last place; erf is taken lane by lane.
"""

import math

from decomposition.deferred import register_jitable, with_numba


def choose(condition, yes, no):
    """Lane by lane, or of numbers: `yes` where the condition is greater than zero, else (also where it is NaN) `no`."""
    return yes if condition > 0.0 else no


def some_positive(value):
    """True when a lane, or the number, is greater than zero (false for NaN)."""
    return value > 0.0


@register_jitable
def power(base, exponent):
    """base^exponent of a base that is not negative (below 1e-300 it counts as that)."""
    return math.exp(exponent * math.log(max(base, 1e-300)))


def _lowering():
    """Imported with numba; kernels are compiled from its text."""
    from parsolid.numerics import elementary_lowering

    return elementary_lowering


with_numba(_lowering)
