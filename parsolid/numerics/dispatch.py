"""One function, several implementations: chosen by the type of one argument, when a kernel is compiled or plain Python
calls.

@generic
def flow_stress(model, plastic_strain, rate): "The flow stress [Pa]."

@flow_stress.of(JohnsonCook)
def _johnson_cook(model, plastic_strain, rate): return model.yield_stress + ...
"""

import functools

import numpy as np

from decomposition.deferred import overload
from parsolid.numerics.lanes import LANES
from parsolid.numerics.tensors import Tensor, as_tensor


def is_instance(numba_type, named_tuple_class) -> bool:
    """True when a numba type is that of the given NamedTuple class."""
    from numba import types

    return isinstance(numba_type, types.BaseNamedTuple) and numba_type.instance_class is named_tuple_class


def _written(parameters, expression: str, **names):
    """A function of these parameters; numba wants them by their names."""
    exec(f"def written({', '.join(parameters)}):\n    return {expression}", names)
    return names["written"]


def _parameters(function):
    """Names of the arguments of a function that takes them by position."""
    return function.__code__.co_varnames[: function.__code__.co_argcount]


def constant(function):
    """Decorator of a function of its arguments' types alone, a constant in kernels.

    There it is given of each argument what the type tells: NamedTuples of such, None, else the numba type.
    """
    parameters = _parameters(function)

    @overload(function, strict=False)
    def choose(*arguments):
        return _written(parameters, "value", value=function(*map(_told_by, arguments)))

    return function


def _told_by(numba_type):
    from numba import types

    if isinstance(numba_type, types.NoneType):
        return None
    if isinstance(numba_type, types.BaseNamedTuple):
        return numba_type.instance_class(*map(_told_by, numba_type.types))
    return numba_type


class Generic:
    """The implementations of a documented stub, see `generic`."""

    def __init__(self, stub, on: str | None):
        self.stub, self.parameters = stub, list(_parameters(stub))
        self.position = self.parameters.index(on) if on else 0
        self.tensors = [i for i, name in enumerate(self.parameters) if stub.__annotations__.get(name) is Tensor]
        self.implementations, self.default = {}, None

    def of(self, *kinds):
        """Decorator of the implementation for NamedTuple classes, dimensions of arrays, lengths of tuples, or None."""

        def decorate(function):
            self.implementations.update(dict.fromkeys(kinds, function))
            return function

        return decorate

    def otherwise(self, function):
        """Decorator of the implementation where no other fits."""
        self.default = function
        return function

    def find(self, kind):
        """The implementation for a key; TypeError, with both names, where there is none."""
        for base in kind.__mro__ if isinstance(kind, type) else (kind,):
            if base in self.implementations:
                return self.implementations[base]
        if self.default is None:
            name = kind.__name__ if isinstance(kind, type) else kind
            known = ", ".join(sorted(k.__name__ if isinstance(k, type) else str(k) for k in self.implementations))
            raise TypeError(f"{self.stub.__name__} has no implementation for {name} (it has those for {known})")
        return self.default

    def has(self, kind: type) -> bool:
        """Whether there is an implementation for a class, the default not counted."""
        return any(base in self.implementations for base in kind.__mro__)

    def compiled_choice(self, arguments):
        """What numba compiles for argument types."""
        from numba.core.errors import TypingError

        from parsolid.numerics.tracing_lowering import is_tensor, tensor_class

        plain = [i for i in self.tensors if not is_tensor(arguments[i]) and tensor_class(arguments[i])]
        if plain:
            given = ", ".join(f"as_tensor({name})" if i in plain else name for i, name in enumerate(self.parameters))
            return _written(self.parameters, f"function({given})", function=self.function, as_tensor=as_tensor)
        try:
            return self.find(_key_of_type(arguments[self.position]))
        except TypeError as error:
            raise TypingError(str(error)) from None

    def called(self, *arguments):
        """What plain Python calls."""
        given = list(arguments)
        for i in self.tensors:
            if type(given[i]) is tuple:
                given[i] = as_tensor(given[i])
        return self.find(_key_of_value(given[self.position]))(*given)


def generic(stub=None, *, on: str | None = None):
    """Decorator of a documented stub: a function with implementations by the type of the argument `on`, the first
    unless given.

    They are added by `@function.of(...)` and `@function.otherwise`, in plain Python that numba compiles into the
    kernels that call it; arguments are positional. Arguments annotated as `Tensor` may be plain tuples. Raises
    TypeError (in a kernel numba's TypingError) naming function and type where no implementation fits.
    """
    if stub is None:
        return functools.partial(generic, on=on)
    table = Generic(stub, on)

    @functools.wraps(stub)
    def function(*arguments):
        return table.called(*arguments)

    @overload(function, strict=False)
    def choose(*arguments):
        return table.compiled_choice(arguments)

    table.function, function.of, function.otherwise, function.table = function, table.of, table.otherwise, table
    return function


def _key_of_type(numba_type):
    from numba import types

    if numba_type.name == LANES:
        return LANES
    if isinstance(numba_type, types.NoneType | types.Omitted):
        return None
    if isinstance(numba_type, types.BaseNamedTuple):
        return numba_type.instance_class
    if isinstance(numba_type, types.BaseTuple):
        return len(numba_type)
    return numba_type.ndim if isinstance(numba_type, types.Array) else type(numba_type)


def _key_of_value(value):
    if type(value) is tuple:
        return len(value)
    return value.ndim if isinstance(value, np.ndarray) else None if value is None else type(value)


def none_without(argument: str, returns: str | None = None, *, inlined: bool = False):
    """Decorator: jitted where it is called; where the named argument is None it gives back another argument, or None.

    inlined: LLVM never makes it a call, which would pass all lanes through memory.

    numba prunes `if x is None` only when x is None, so that a function with two kinds of result
    would have to unify their types.
    """

    def decorate(function):
        names = _parameters(function)
        position = names.index(argument)
        instead = None if returns is None else names.index(returns)

        @functools.wraps(function)
        def called(*arguments):
            if arguments[position] is None:
                return None if instead is None else arguments[instead]
            return function(*arguments)

        @overload(called, strict=False, jit_options={"forceinline": inlined})
        def choose(*arguments):
            from numba import types

            if isinstance(arguments[position], types.NoneType):
                return (lambda *arguments: None) if instead is None else (lambda *arguments: arguments[instead])
            return function

        return called

    return decorate
