"""What numba is told of lanes (`lanes`): their type, operators and intrinsics, as LLVM instructions."""

import math
import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import intrinsic, models, register_model

from parsolid.numerics.lanes import LANES, WIDTH

_DOUBLE = ir.DoubleType()
_VECTOR = ir.VectorType(_DOUBLE, WIDTH)
_INT = ir.IntType(32)


class LanesType(types.Type):
    """numba type of four float64 lanes; vector: LLVM's."""

    vector = _VECTOR

    def __init__(self):
        super().__init__(name=LANES)


lanes = LanesType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, numba_type):
        super().__init__(manager, numba_type, _VECTOR)


def splat(builder, value, vector=_VECTOR):
    """A double in every lane of an LLVM vector."""
    none = ir.Constant(vector, ir.Undefined)
    everywhere = ir.Constant(ir.VectorType(_INT, vector.count), [0] * vector.count)
    return builder.shuffle_vector(builder.insert_element(none, value, _INT(0)), none, everywhere)


def to_vector_of(kind, vector):
    """What turns a value into lanes of a kind, an LLVM vector: lanes as they are, numbers repeated in every lane."""

    def to_vector(context, builder, value, numba_type):
        if isinstance(numba_type, type(kind)):
            return value
        return splat(builder, context.cast(builder, value, numba_type, types.float64), vector)

    return to_vector


_to_vector = to_vector_of(lanes, _VECTOR)


def let_apply(kind, to_vector, function, emit):
    """Let compiled functions apply a Python function or operator to lanes of a kind, and to numbers beside them: one
    instruction, with nothing to compile for it.

    to_vector: `to_vector_of` the kind; emit: adds the instruction.
    """

    class Template(AbstractTemplate):
        key = function

        def generic(self, arguments, keywords):
            known = (type(kind), types.Float, types.Integer)
            fits = any(isinstance(a, type(kind)) for a in arguments) and all(isinstance(a, known) for a in arguments)
            return kind(*arguments) if fits and not keywords else None

        def get_impl_key(self, sig):
            return emit

    infer_global(function)(Template)

    @lower_builtin(emit, types.VarArg(types.Any))
    def lower(context, builder, sig, arguments):
        return emit(context, builder, *(to_vector(context, builder, a, t) for a, t in zip(arguments, sig.args)))


def _direct(function, emit):
    let_apply(lanes, _to_vector, function, emit)


def let_calculate(kind, to_vector):
    """Let compiled functions add, subtract, multiply and divide lanes of a kind, and take the lesser and the greater,
    lane by lane; the second argument where either is NaN.
    """

    def instruction(name):
        return lambda context, builder, x, y: getattr(builder, name)(x, y)

    def choice(comparison):
        return lambda context, builder, x, y: builder.select(builder.fcmp_ordered(comparison, x, y), x, y)

    for function, emit in (
        (operator.add, instruction("fadd")),
        (operator.sub, instruction("fsub")),
        (operator.mul, instruction("fmul")),
        (operator.truediv, instruction("fdiv")),
        (min, choice("<")),
        (max, choice(">")),
    ):
        let_apply(kind, to_vector, function, emit)


let_calculate(lanes, _to_vector)
_direct(operator.neg, lambda context, builder, x: builder.fneg(x))


def _llvm_call(context, builder, name, result, arguments):
    function_type = ir.FunctionType(result, [argument.type for argument in arguments])
    return builder.call(cgutils.get_or_insert_function(builder.module, function_type, name), arguments)


_direct(math.sqrt, lambda context, builder, x: _llvm_call(context, builder, "llvm.sqrt.v4f64", _VECTOR, [x]))


def fused_of(kind, vector, to_vector):
    """An intrinsic that gives x * y + z in lanes of a kind, rounded once; numbers are repeated in every lane."""

    @intrinsic
    def fused(typing_context, x, y, z):
        def generate(context, builder, signature, arguments):
            vectors = [to_vector(context, builder, a, t) for a, t in zip(arguments, signature.args)]
            return _llvm_call(context, builder, f"llvm.fma.v{vector.count}f64", vector, vectors)

        return kind(x, y, z), generate

    return fused


def broadcast_of(kind, to_vector):
    """An intrinsic that puts a number in every lane of a kind."""

    @intrinsic
    def broadcast(typing_context, value):
        def generate(context, builder, signature, arguments):
            return to_vector(context, builder, arguments[0], signature.args[0])

        return kind(value), generate

    return broadcast


fused, broadcast = fused_of(lanes, _VECTOR, _to_vector), broadcast_of(lanes, _to_vector)


def _element_pointer(context, builder, array_type, array, row, column):
    structure = context.make_array(array_type)(context, builder, array)
    indices = [row] if array_type.ndim == 1 else [row, column]
    return cgutils.get_item_pointer(context, builder, array_type, structure, indices, wraparound=False)


def _index_signature(result, array, row, column, *more):
    return result(array, types.intp, types.intp, *more)


@intrinsic
def load(typing_context, array, row, column):
    """Four consecutive numbers array[row, column : column + 4] of a C-contiguous (n, c) array."""

    def generate(context, builder, signature, arguments):
        pointer = _element_pointer(context, builder, signature.args[0], *arguments)
        return builder.load(builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)

    return _index_signature(lanes, array, row, column), generate


@intrinsic
def store(typing_context, array, row, column, value):
    """array[row, column : column + 4] = value."""

    def generate(context, builder, signature, arguments):
        pointer = _element_pointer(context, builder, signature.args[0], *arguments[:3])
        builder.store(arguments[3], builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)
        return context.get_dummy_value()

    return _index_signature(types.none, array, row, column, lanes), generate


@intrinsic
def store_first(typing_context, array, row, column, value, count):
    """The first `count` lanes of value into array[row, column : column + count]."""

    def generate(context, builder, signature, arguments):
        pointer = _element_pointer(context, builder, signature.args[0], *arguments[:3])
        pointer = builder.bitcast(pointer, _VECTOR.as_pointer())
        integers = ir.VectorType(ir.IntType(64), WIDTH)
        counts = builder.insert_element(ir.Constant(integers, ir.Undefined), arguments[4], _INT(0))
        counts = builder.shuffle_vector(
            counts, ir.Constant(integers, ir.Undefined), ir.Constant(ir.VectorType(_INT, WIDTH), [0] * WIDTH)
        )
        mask = builder.icmp_signed("<", ir.Constant(integers, list(range(WIDTH))), counts)
        mask_type = ir.VectorType(ir.IntType(1), WIDTH)
        function_type = ir.FunctionType(ir.VoidType(), [_VECTOR, _VECTOR.as_pointer(), _INT, mask_type])
        name = "llvm.masked.store.v4f64.p0" if opaque_pointers() else "llvm.masked.store.v4f64.p0v4f64"
        function = cgutils.get_or_insert_function(builder.module, function_type, name)
        builder.call(function, [arguments[3], pointer, _INT(8), mask])
        return context.get_dummy_value()

    return _index_signature(types.none, array, row, column, lanes, types.int64), generate


def opaque_pointers():
    """Whether LLVM's pointers say nothing of what they point to."""
    import llvmlite.binding

    return llvmlite.binding.llvm_version_info[0] >= 16


@intrinsic
def lane(typing_context, value, index):
    """One lane as a float64."""

    def generate(context, builder, signature, arguments):
        return builder.extract_element(arguments[0], builder.trunc(arguments[1], _INT))

    return types.float64(lanes, types.int64), generate


@intrinsic
def from_floats(typing_context, first, second, third, fourth):
    """Lanes from four numbers."""

    def generate(context, builder, signature, arguments):
        vector = ir.Constant(_VECTOR, ir.Undefined)
        for position, value in enumerate(arguments):
            vector = builder.insert_element(vector, value, _INT(position))
        return vector

    return lanes(types.float64, types.float64, types.float64, types.float64), generate


def shuffle(*indices):
    """An intrinsic that puts lane indices[k] of its first argument, or indices[k] - 4 of its second, into lane k."""

    @intrinsic
    def apply(typing_context, first, second):
        def generate(context, builder, signature, arguments):
            return builder.shuffle_vector(arguments[0], arguments[1], _mask(indices))

        return lanes(lanes, lanes), generate

    return apply


def _mask(indices):
    return ir.Constant(ir.VectorType(_INT, WIDTH), list(indices))


def swizzle(*indices):
    """An intrinsic that puts lane indices[k] of its argument into lane k."""

    @intrinsic
    def apply(typing_context, value):
        def generate(context, builder, signature, arguments):
            return builder.shuffle_vector(arguments[0], ir.Constant(_VECTOR, ir.Undefined), _mask(indices))

        return lanes(lanes), generate

    return apply


@intrinsic
def without_fourth(typing_context, value):
    """The value with lane 3 set to zero."""

    def generate(context, builder, signature, arguments):
        return builder.shuffle_vector(arguments[0], ir.Constant(_VECTOR, [0.0] * WIDTH), _mask((0, 1, 2, 7)))

    return lanes(lanes), generate


@intrinsic
def horizontal_sums(typing_context, a, b, c, d):
    """Lanes (sum of a, sum of b, sum of c, sum of d)."""

    def generate(context, builder, signature, arguments):
        def pairwise(x, y):
            even = builder.shuffle_vector(x, y, _mask((0, 4, 2, 6)))
            return builder.fadd(even, builder.shuffle_vector(x, y, _mask((1, 5, 3, 7))))

        first, second = pairwise(*arguments[:2]), pairwise(*arguments[2:])
        low = builder.shuffle_vector(first, second, _mask((0, 1, 4, 5)))
        return builder.fadd(low, builder.shuffle_vector(first, second, _mask((2, 3, 6, 7))))

    return lanes(lanes, lanes, lanes, lanes), generate


@intrinsic
def last_two_roots(typing_context, value):
    """Square roots of lanes 2 and 3 as floats: two roots take half the time of four."""

    def generate(context, builder, signature, arguments):
        pair_type = ir.VectorType(_DOUBLE, 2)
        mask = ir.Constant(ir.VectorType(_INT, 2), [2, 3])
        pair = builder.shuffle_vector(arguments[0], ir.Constant(_VECTOR, ir.Undefined), mask)
        roots = _llvm_call(context, builder, "llvm.sqrt.v2f64", pair_type, [pair])
        return context.make_tuple(
            builder, signature.return_type, [builder.extract_element(roots, _INT(k)) for k in (0, 1)]
        )

    return types.UniTuple(types.float64, 2)(lanes), generate


@intrinsic
def transpose(typing_context, a, b, c, d):
    """The 4 x 4 transpose: lane j of result i is lane i of argument j."""

    def generate(context, builder, signature, arguments):
        x, y, z, w = arguments
        low, high = builder.shuffle_vector(x, y, _mask((0, 4, 2, 6))), builder.shuffle_vector(x, y, _mask((1, 5, 3, 7)))
        low2, high2 = (
            builder.shuffle_vector(z, w, _mask((0, 4, 2, 6))),
            builder.shuffle_vector(z, w, _mask((1, 5, 3, 7))),
        )
        rows = (
            builder.shuffle_vector(low, low2, _mask((0, 1, 4, 5))),
            builder.shuffle_vector(high, high2, _mask((0, 1, 4, 5))),
            builder.shuffle_vector(low, low2, _mask((2, 3, 6, 7))),
            builder.shuffle_vector(high, high2, _mask((2, 3, 6, 7))),
        )
        return context.make_tuple(builder, signature.return_type, rows)

    return types.UniTuple(lanes, WIDTH)(lanes, lanes, lanes, lanes), generate


@intrinsic
def all_positive(typing_context, value):
    """True when every lane is greater than zero (false for NaN)."""

    def generate(context, builder, signature, arguments):
        positive = builder.fcmp_ordered(">", arguments[0], ir.Constant(_VECTOR, [0.0] * WIDTH))
        bits = builder.bitcast(positive, ir.IntType(WIDTH))
        return builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(WIDTH), (1 << WIDTH) - 1))

    return types.boolean(lanes), generate
