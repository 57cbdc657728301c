"""What numba is told of wide lanes (`wide_lanes`), as LLVM instructions."""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from parsolid.numerics.lanes_lowering import broadcast_of, fused_of, let_calculate, to_vector_of
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


_to_vector = to_vector_of(wide_lanes, _VECTOR)
let_calculate(wide_lanes, _to_vector)
fused_wide, broadcast_wide = fused_of(wide_lanes, _VECTOR, _to_vector), broadcast_of(wide_lanes, _to_vector)


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
