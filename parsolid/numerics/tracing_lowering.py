"""What numba is told of traced formulas (`tracing`), and the symbols that they are run on."""

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_getattr, infer_global, signature
from numba.extending import lower_getattr

from parsolid.numerics.lanes_lowering import LanesType, splat
from parsolid.numerics.tracing import BY_SIZE, Traceable, Unknown
from parsolid.numerics.wide_lanes_lowering import WideLanesType

_DOUBLE = ir.DoubleType()


class Symbol(Unknown):
    """A float or lanes whose value is known only to the compiler; without a builder only its type counts.

    lanes: the numba type of lanes, None of a float.
    """

    __slots__ = ("builder", "lanes", "value")

    def __init__(self, lanes, builder=None, value=None):
        self.lanes, self.builder, self.value = lanes, builder, value

    def _in_lanes(self, kind):
        return self.value if self.lanes else splat(self.builder, self.value, kind.vector)

    def _emitted(self, instruction: str, first, second):
        pair = [self.number(x, self.builder) for x in (first, second)]
        if None in pair:
            return NotImplemented
        kind = pair[0].lanes or pair[1].lanes
        if self.builder is None:
            return Symbol(kind)
        values = [x._in_lanes(kind) if kind else x.value for x in pair]
        return Symbol(kind, self.builder, getattr(self.builder, instruction)(*values))

    @staticmethod
    def number(value, builder) -> "Symbol | None":
        """A symbol as it is, a number as a constant; None of anything else."""
        if isinstance(value, Symbol):
            return value
        if not isinstance(value, int | float):
            return None
        return Symbol(None, builder, None if builder is None else ir.Constant(_DOUBLE, float(value)))

    def __add__(self, other):
        return self._emitted("fadd", self, other)

    def __radd__(self, other):
        return self._emitted("fadd", other, self)

    def __sub__(self, other):
        return self._emitted("fsub", self, other)

    def __rsub__(self, other):
        return self._emitted("fsub", other, self)

    def __mul__(self, other):
        return self._emitted("fmul", self, other)

    def __rmul__(self, other):
        return self._emitted("fmul", other, self)

    def __truediv__(self, other):
        return self._emitted("fdiv", self, other)

    def __rtruediv__(self, other):
        return self._emitted("fdiv", other, self)

    def __neg__(self):
        return Symbol(self.lanes, self.builder, None if self.builder is None else self.builder.fneg(self.value))

    def lane(self, k):
        """Lane k, a raw index; a float is the same in all lanes."""
        if not self.lanes:
            return self
        if self.builder is None:
            return Symbol(None)
        index = self.builder.trunc(k, ir.IntType(32))
        return Symbol(None, self.builder, self.builder.extract_element(self.value, index))


def is_tensor(numba_type) -> bool:
    """Whether a numba type is that of a tensor."""
    return isinstance(numba_type, types.BaseNamedTuple) and issubclass(numba_type.instance_class, Traceable)


def tensor_class(numba_type) -> type | None:
    """The class of a tensor's numba type, or of a plain tuple of as many scalars as a tensor has; else None."""
    if is_tensor(numba_type):
        return numba_type.instance_class
    plain = isinstance(numba_type, types.BaseTuple) and not isinstance(numba_type, types.BaseNamedTuple)
    return BY_SIZE.get(len(numba_type)) if plain and all(map(_is_scalar, numba_type)) else None


def _is_scalar(numba_type) -> bool:
    return isinstance(numba_type, LanesType | WideLanesType | types.Float | types.Integer)


def _symbols(numba_type, context=None, builder=None, value=None):
    """An argument as the formula sees it; TypeError where a formula takes no such thing."""
    if isinstance(numba_type, types.NoneType):
        return None
    if isinstance(numba_type, types.BaseTuple):
        values = [None] * len(numba_type) if builder is None else cgutils.unpack_tuple(builder, value, len(numba_type))
        symbols = tuple(_symbols(t, context, builder, v) for t, v in zip(numba_type, values))
        kind = tensor_class(numba_type)
        return symbols if kind is None else kind(*symbols)
    if not _is_scalar(numba_type):
        raise TypeError(f"a formula takes tensors and scalars, not {numba_type}")
    kind = numba_type if isinstance(numba_type, LanesType | WideLanesType) else None
    if builder is not None and kind is None:
        value = context.cast(builder, value, numba_type, types.float64)
    return Symbol(kind, builder, value)


def _type_of(result):
    """The numba type of what a formula gave back."""
    if result is None:
        return types.none
    if isinstance(result, Traceable):
        return types.BaseTuple.from_types(tuple(map(_type_of, result)), type(result))
    return (isinstance(result, Symbol) and result.lanes) or types.float64


def _value_of(context, builder, result, numba_type):
    if result is None:
        return context.get_dummy_value()
    if isinstance(result, Traceable):
        values = [_value_of(context, builder, x, t) for x, t in zip(result, numba_type)]
        return context.make_tuple(builder, numba_type, values)
    return Symbol.number(result, builder).value


def _signature(formula, arguments, with_index: bool):
    """The signature of a formula for argument types; None where it does not take them."""
    last = len(arguments) - 1
    try:
        result = formula(*(None if with_index and i == last else _symbols(t) for i, t in enumerate(arguments)))
    except (TypeError, IndexError, KeyError, AttributeError):
        return None
    return signature(_type_of(result), *arguments)


def _lowering(formula, with_index: bool):
    def lower(context, builder, sig, arguments):
        last = len(arguments) - 1
        given = [
            context.cast(builder, v, t, types.int64) if with_index and i == last else _symbols(t, context, builder, v)
            for i, (t, v) in enumerate(zip(sig.args, arguments))
        ]
        return _value_of(context, builder, formula(*given), sig.return_type)

    return lower


def trace(formula, with_index: bool) -> None:
    """Let compiled functions call a formula; see `tracing.traced`."""

    class Template(AbstractTemplate):
        key = formula

        def generic(self, arguments, keywords):
            return None if keywords else _signature(formula, arguments, with_index)

    infer_global(formula, types.Function(Template))
    lower_builtin(formula, types.VarArg(types.Any))(_lowering(formula, with_index))


def traced_operator(symbol):
    """Let compiled functions apply one of Python's operators to tensors, as the tensors' classes define it."""

    def formula(*arguments):
        return symbol(*arguments)

    class Template(AbstractTemplate):
        key = symbol

        def generic(self, arguments, keywords):
            return _signature(formula, arguments, False) if any(map(is_tensor, arguments)) else None

        def get_impl_key(self, sig):
            return formula

    infer_global(symbol)(Template)
    lower_builtin(formula, types.VarArg(types.Any))(_lowering(formula, False))


for _symbol in (operator.add, operator.sub, operator.mul, operator.truediv, operator.matmul, operator.neg):
    traced_operator(_symbol)


def _transposed(a):
    return a.T


@infer_getattr
class _Attributes(AttributeTemplate):
    key = types.BaseNamedTuple

    def resolve_T(self, numba_type):
        return _signature(_transposed, (numba_type,), False).return_type if is_tensor(numba_type) else None


@lower_getattr(types.BaseNamedTuple, "T")
def _lower_transposed(context, builder, numba_type, value):
    result = _transposed(_symbols(numba_type, context, builder, value))
    return _value_of(context, builder, result, _type_of(result))
