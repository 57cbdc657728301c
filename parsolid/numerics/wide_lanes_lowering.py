"""What numba is told of wide lanes (`wide_lanes`), as LLVM instructions."""

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from parsolid.numerics.lanes_lowering import let_apply
from parsolid.numerics.wide_lanes import WIDE

_VECTOR = ir.VectorType(ir.DoubleType(), WIDE)


class WideLanesType(types.Type):
    """numba type of `WIDE` float64 lanes."""

    def __init__(self):
        super().__init__(name=f"WideLanes{WIDE}")


wide_lanes = WideLanesType()


@register_model(WideLanesType)
class _WideLanesModel(models.PrimitiveModel):
    def __init__(self, manager, numba_type):
        super().__init__(manager, numba_type, _VECTOR)


def _to_vector(context, builder, value, numba_type):
    """Lanes as they are; numbers repeated in every lane."""
    if isinstance(numba_type, WideLanesType):
        return value
    number, none = context.cast(builder, value, numba_type, types.float64), ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(none, number, ir.IntType(32)(0))
    return builder.shuffle_vector(first, none, ir.Constant(ir.VectorType(ir.IntType(32), WIDE), [0] * WIDE))


def _direct(function, emit):
    let_apply(wide_lanes, _to_vector, function, emit)


def _binary(python_operator, instruction):
    _direct(python_operator, lambda context, builder, x, y: getattr(builder, instruction)(x, y))


_binary(operator.add, "fadd")
_binary(operator.sub, "fsub")
_binary(operator.mul, "fmul")
_binary(operator.truediv, "fdiv")
# the second one where either is NaN
_direct(max, lambda context, builder, x, y: builder.select(builder.fcmp_ordered(">", x, y), x, y))


@intrinsic
def fused_wide(typing_context, x, y, z):
    """x * y + z, rounded once; numbers are repeated in every lane."""

    def generate(context, builder, signature, arguments):
        vectors = [_to_vector(context, builder, a, t) for a, t in zip(arguments, signature.args)]
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        name = f"llvm.fma.v{WIDE}f64"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), vectors)

    return wide_lanes(x, y, z), generate


@intrinsic
def broadcast_wide(typing_context, value):
    """A number in every lane."""

    def generate(context, builder, signature, arguments):
        return _to_vector(context, builder, arguments[0], signature.args[0])

    return wide_lanes(value), generate


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
