"""What numba is told of elementary functions on lanes (`elementary`)."""

import math

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload, register_jitable

from parsolid.numerics.elementary import choose, some_positive
from parsolid.numerics.lanes_lowering import (
    _VECTOR,
    WIDTH,
    LanesType,
    _llvm_call,
    _to_vector,
    broadcast,
    from_floats,
    fused,
    lane,
    lanes,
)

_INTEGERS = ir.VectorType(ir.IntType(64), WIDTH)
# ln 2 in two parts: the first has few enough digits that n ln 2 is exact
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
# highest powers first, odd and even ones apart: two short chains of products instead of one long
_EXP_ODD, _EXP_EVEN = (tuple(1.0 / math.factorial(k) for k in range(first, -1, -2)) for first in (13, 12))
_LOG_ODD, _LOG_EVEN = (tuple(2.0 / (2 * k + 1) for k in range(first, 0, -2)) for first in (11, 10))


@intrinsic
def _select(typing_context, condition, yes, no):
    def generate(context, builder, signature, arguments):
        mask = builder.fcmp_ordered(">", arguments[0], ir.Constant(_VECTOR, [0.0] * WIDTH))
        vectors = [_to_vector(context, builder, a, t) for a, t in zip(arguments[1:], signature.args[1:])]
        return builder.select(mask, *vectors)

    return lanes(condition, yes, no), generate


@overload(choose)
def _choose(condition, yes, no):
    if isinstance(condition, LanesType):
        return lambda condition, yes, no: _select(condition, yes, no)  # noqa: PLW0108 (an intrinsic is no function)
    if isinstance(yes, LanesType) or isinstance(no, LanesType):
        return lambda condition, yes, no: _select(broadcast(condition), yes, no)
    return lambda condition, yes, no: yes if condition > 0.0 else no


@intrinsic
def _any_positive(typing_context, value):
    def generate(context, builder, signature, arguments):
        positive = builder.fcmp_ordered(">", arguments[0], ir.Constant(_VECTOR, [0.0] * WIDTH))
        return builder.icmp_unsigned(
            "!=", builder.bitcast(positive, ir.IntType(WIDTH)), ir.Constant(ir.IntType(WIDTH), 0)
        )

    return types.boolean(value), generate


@overload(some_positive)
def _some_positive(value):
    if isinstance(value, LanesType):
        return lambda value: _any_positive(value)  # noqa: PLW0108
    return lambda value: value > 0.0


def _integers(value: int):
    return ir.Constant(_INTEGERS, [value] * WIDTH)


@intrinsic
def _nearest(typing_context, value):
    """Each lane rounded to the nearest whole number."""

    def generate(context, builder, signature, arguments):
        return _llvm_call(context, builder, "llvm.rint.v4f64", arguments[0].type, arguments)

    return lanes(value), generate


@intrinsic
def _power_of_two(typing_context, exponent):
    """2^n of whole n in [-1022, 1023]."""

    def generate(context, builder, signature, arguments):
        bits = builder.add(builder.fptosi(arguments[0], _INTEGERS), _integers(1023))
        return builder.bitcast(builder.shl(bits, _integers(52)), arguments[0].type)

    return lanes(exponent), generate


@intrinsic
def _mantissa_and_exponent(typing_context, value):
    """m in [1, 2) and n with m 2^n = value, of positive normal lanes."""

    def generate(context, builder, signature, arguments):
        vector = arguments[0].type
        bits = builder.bitcast(arguments[0], _INTEGERS)
        exponent = builder.sitofp(builder.sub(builder.lshr(bits, _integers(52)), _integers(1023)), vector)
        mantissa = builder.or_(builder.and_(bits, _integers((1 << 52) - 1)), _integers(1023 << 52))
        return context.make_tuple(builder, signature.return_type, [builder.bitcast(mantissa, vector), exponent])

    return types.UniTuple(lanes, 2)(value), generate


@register_jitable
def _horner(coefficients, x):
    """A polynomial, the coefficient of its highest power first."""
    result = fused(x, coefficients[0], coefficients[1])
    for k in range(2, len(coefficients)):
        result = fused(result, x, coefficients[k])
    return result


@overload(math.exp)
def _exp(x):
    if not isinstance(x, LanesType):
        return None

    def exponential(x):
        # outside of this e^x has no normal double
        x = max(min(x, 709.0), -708.0)
        n = _nearest(x * 1.4426950408889634)
        r = fused(n, -_LN2_LOW, fused(n, -_LN2_HIGH, x))
        square = r * r
        return fused(r, _horner(_EXP_ODD, square), _horner(_EXP_EVEN, square)) * _power_of_two(n)

    return exponential


@overload(math.log)
def _log(x):
    if not isinstance(x, LanesType):
        return None

    def logarithm(x):
        m, n = _mantissa_and_exponent(max(x, 2.3e-308))
        large = m - 1.4142135623730951
        m, n = choose(large, 0.5 * m, m), choose(large, n + 1.0, n)
        # ln m = 2 artanh f = 2 f (1 + f^2/3 + f^4/5 + ...), |f| < 0.172
        f = (m - 1.0) / (m + 1.0)
        square = f * f
        fourth = square * square
        series = fused(square, _horner(_LOG_EVEN, fourth), _horner(_LOG_ODD, fourth)) * square
        return fused(n, _LN2_HIGH, fused(n, _LN2_LOW, fused(f, series, 2.0 * f)))

    return logarithm


@overload(math.erf)
def _erf(x):
    if isinstance(x, LanesType):
        return lambda x: from_floats(
            math.erf(lane(x, 0)), math.erf(lane(x, 1)), math.erf(lane(x, 2)), math.erf(lane(x, 3))
        )
