"""What numba is told of wide lanes (`wide_lanes`), as LLVM instructions."""

import math
import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from parsolid.numerics.lanes_lowering import (
    WIDTH,
    broadcast_of,
    fused_of,
    lanes,
    let_apply,
    let_calculate,
    opaque_pointers,
    to_vector_of,
)
from parsolid.numerics.wide_lanes import WIDE

_VECTOR = ir.VectorType(ir.DoubleType(), WIDE)


class WideLanesType(types.Type):
    """numba type of `WIDE` float64 lanes; vector: LLVM's."""

    vector = _VECTOR

    def __init__(self):
        super().__init__(name=f"WideLanes{WIDE}")


wide_lanes = WideLanesType()


@register_model(WideLanesType)
class _WideLanesModel(models.PrimitiveModel):
    def __init__(self, manager, numba_type):
        super().__init__(manager, numba_type, _VECTOR)


_to_vector = to_vector_of(wide_lanes, _VECTOR)
let_calculate(wide_lanes, _to_vector)
fused_wide, broadcast_wide = fused_of(wide_lanes, _VECTOR, _to_vector), broadcast_of(wide_lanes, _to_vector)


_INT = ir.IntType(32)


def _intrinsic_call(context, builder, name, result, arguments):
    kind = ir.FunctionType(result, [argument.type for argument in arguments])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), arguments)


def _root(context, builder, x):
    return _intrinsic_call(context, builder, f"llvm.sqrt.v{WIDE}f64", _VECTOR, [x])


let_apply(wide_lanes, _to_vector, math.sqrt, _root)
let_apply(wide_lanes, _to_vector, operator.neg, lambda context, builder, x: builder.fneg(x))


def _pointer(context, builder, array_type, array, row):
    structure = context.make_array(array_type)(context, builder, array)
    pointer = cgutils.get_item_pointer(context, builder, array_type, structure, [row], wraparound=False)
    return builder.bitcast(pointer, _VECTOR.as_pointer())


@intrinsic
def load_wide(typing_context, array, row):
    """Consecutive numbers of a one-dimensional array, from array[row] on."""

    def generate(context, builder, signature, arguments):
        return builder.load(_pointer(context, builder, signature.args[0], *arguments), align=8)

    return wide_lanes(array, types.intp), generate


@intrinsic
def store_wide(typing_context, array, row, value):
    """array[row : row + WIDE] = value."""

    def generate(context, builder, signature, arguments):
        builder.store(arguments[2], _pointer(context, builder, signature.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.none(array, types.intp, wide_lanes), generate


def _row_pointer(context, builder, array_type, array, row, column):
    structure = context.make_array(array_type)(context, builder, array)
    pointer = cgutils.get_item_pointer(context, builder, array_type, structure, [row, column], wraparound=False)
    return builder.bitcast(pointer, _VECTOR.as_pointer())


@intrinsic
def load_row_wide(typing_context, array, row, column):
    """Consecutive numbers of a row of a C-contiguous (n, c) array, from array[row, column] on."""

    def generate(context, builder, signature, arguments):
        return builder.load(_row_pointer(context, builder, signature.args[0], *arguments), align=8)

    return wide_lanes(array, types.intp, types.intp), generate


def _first(builder, count, width):
    """A mask of the first `count` lanes."""
    integers = ir.VectorType(ir.IntType(64), width)
    counts = builder.insert_element(ir.Constant(integers, ir.Undefined), count, _INT(0))
    everywhere = ir.Constant(ir.VectorType(_INT, width), [0] * width)
    counts = builder.shuffle_vector(counts, ir.Constant(integers, ir.Undefined), everywhere)
    return builder.icmp_signed("<", ir.Constant(integers, list(range(width))), counts)


@intrinsic
def store_first_wide(typing_context, array, row, column, value, count):
    """The first `count` lanes of value into array[row, column : column + count]."""

    def generate(context, builder, signature, arguments):
        pointer = _row_pointer(context, builder, signature.args[0], *arguments[:3])
        mask = _first(builder, arguments[4], WIDE)
        name = f"llvm.masked.store.v{WIDE}f64.p0" + ("" if opaque_pointers() else f"v{WIDE}f64")
        _intrinsic_call(context, builder, name, ir.VoidType(), [arguments[3], pointer, _INT(8), mask])
        return context.get_dummy_value()

    return types.none(array, types.intp, types.intp, wide_lanes, types.int64), generate


@intrinsic
def first_lanes(typing_context, value, count):
    """The first `count` lanes of a value of either kind, and zeros."""

    def generate(context, builder, signature, arguments):
        vector = signature.args[0].vector
        none = ir.Constant(vector, [0.0] * vector.count)
        return builder.select(_first(builder, arguments[1], vector.count), arguments[0], none)

    return value(value, types.int64), generate


@intrinsic
def all_positive_wide(typing_context, value):
    """True when every lane is greater than zero (false for NaN)."""

    def generate(context, builder, signature, arguments):
        positive = builder.fcmp_ordered(">", arguments[0], ir.Constant(_VECTOR, [0.0] * WIDE))
        bits = builder.bitcast(positive, ir.IntType(WIDE))
        return builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(WIDE), (1 << WIDE) - 1))

    return types.boolean(value), generate


def _chosen(builder, first, second, indices):
    return builder.shuffle_vector(first, second, ir.Constant(ir.VectorType(_INT, len(indices)), list(indices)))


@intrinsic
def halves(typing_context, value):
    """The first four lanes and the others, of eight."""

    def generate(context, builder, signature, arguments):
        parts = [_chosen(builder, arguments[0], arguments[0], range(k, k + WIDTH)) for k in (0, WIDTH)]
        return context.make_tuple(builder, signature.return_type, parts)

    return types.UniTuple(lanes, 2)(value), generate


@intrinsic
def joined(typing_context, low, high):
    """Eight lanes from twice four."""

    def generate(context, builder, signature, arguments):
        return _chosen(builder, *arguments, range(2 * WIDTH))

    return wide_lanes(low, high), generate
