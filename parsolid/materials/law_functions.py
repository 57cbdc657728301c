"""Functions that material laws implement, chosen by the type of the law: in kernels when they are compiled, else when
they are called.

    @law_function
    def flow_stress(law, plastic_strain, rate): "The flow stress [Pa]."

    @flow_stress.of(JohnsonCook)
    def johnson_cook(law, plastic_strain, rate):
        return law.yield_stress + ...

Laws are NamedTuples of their parameters. Their functions are plain arithmetic on numbers and on the tuples of
`parsolid.tensors`; kernels copy them in place of the call. An absent part of a law is None, for which a function may
have an implementation too.
"""

import functools
from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import overload


def law_function(declaration: Callable[..., Any]) -> Any:
    """A function whose first argument is the law; raises TypeError, with both names, for a law that does not
    implement it."""
    implementations: dict[Any, Callable[..., Any]] = {}
    defaults: list[Callable[..., Any]] = []

    def find(kind: Any) -> Callable[..., Any]:
        if kind in implementations:
            return implementations[kind]
        if defaults:
            return defaults[0]
        name = "None" if kind is None else kind.__name__
        known = ", ".join(sorted("None" if k is None else k.__name__ for k in implementations))
        raise TypeError(f"{declaration.__name__} has no implementation for {name}; it has those for {known}")

    @functools.wraps(declaration)
    def function(law, *arguments):
        return find(None if law is None else type(law))(law, *arguments)

    def choose(law, *arguments):
        if isinstance(law, types.NoneType) or law is None:
            return find(None)
        return find(law.instance_class)

    overload(function, inline="always", strict=False)(choose)

    def of(*kinds: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        def register(implementation: Callable[..., Any]) -> Callable[..., Any]:
            implementations.update(dict.fromkeys(kinds, implementation))
            return implementation

        return register

    def otherwise(implementation: Callable[..., Any]) -> Callable[..., Any]:
        defaults.append(implementation)
        return implementation

    chosen: Any = function
    chosen.of, chosen.otherwise = of, otherwise
    chosen.has = lambda kind: kind in implementations
    return chosen
