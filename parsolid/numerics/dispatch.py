"""Dispatch on NamedTuple classes inside numba overloads."""

import inspect

from numba import types
from numba.extending import overload


def is_instance(numba_type, named_tuple_class) -> bool:
    """True when a numba type is that of the given NamedTuple class."""
    return isinstance(numba_type, types.BaseNamedTuple) and numba_type.instance_class is named_tuple_class


def field_types(numba_type) -> dict:
    """Field name -> numba type of a NamedTuple's numba type."""
    return dict(zip(numba_type.fields, numba_type.types))


def none_without(argument: str, returns: str | None = None):
    """Decorator: jitted where it is called; where the named argument is None it gives back another argument, or None.

    numba prunes `if x is None` only when x is None, so that a function with two kinds of result
    would have to unify their types.
    """

    def decorate(function):
        names = list(inspect.signature(function).parameters)
        position = names.index(argument)
        instead = None if returns is None else names.index(returns)

        @overload(function, strict=False)
        def choose(*arguments):
            if isinstance(arguments[position], types.NoneType):
                return (lambda *arguments: None) if instead is None else (lambda *arguments: arguments[instead])
            return function

        return function

    return decorate
