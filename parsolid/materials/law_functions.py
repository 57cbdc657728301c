"""Functions that material laws implement, chosen by the type of the law: in kernels when they are compiled, else when
they are called.

    @law_function
    def flow_stress(law, plastic_strain, rate): "The flow stress [Pa]."

    @flow_stress.of(JohnsonCook)
    def johnson_cook(law, plastic_strain, rate):
        return law.yield_stress + ...

Laws are NamedTuples of their parameters. Their functions are plain arithmetic on numbers and on the tuples of
`parsolid.tensors`; kernels copy them in place of the call. A part that a law lacks is None, for which a function may
have an implementation too (`.of(None)`).
"""

import functools
from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import overload

from parsolid.kernels import INLINED


class _Choices:
    """Implementations of one function by the type of the law."""

    def __init__(self, name: str):
        self.name = name
        self.default: Callable[..., Any] | None = None
        self.maker: Callable[[Any], Callable[..., Any]] | None = None
        self.of_kind: dict[Any, Callable[..., Any]] = {}

    def find(self, kind: Any) -> Callable[..., Any]:
        implementation = self.of_kind.get(kind, self.default)
        if implementation is None and self.maker is not None:
            implementation = self.of_kind[kind] = self.maker(kind)
        if implementation is None:
            known = ", ".join(sorted(_name_of(it) for it in self.of_kind))
            raise TypeError(f"{self.name} has no implementation for {_name_of(kind)}; it has those for {known}")
        return implementation


def _name_of(kind: Any) -> str:
    return "None" if kind is None else kind.__name__


def _kind_of_type(law: Any) -> Any:
    """The type of a law from numba's type of it."""
    if law is None or isinstance(law, types.NoneType):
        return None
    if isinstance(law, types.BaseNamedTuple):
        return law.instance_class
    return tuple if isinstance(law, types.BaseTuple) else float


def law_function(declaration: Callable[..., Any]) -> Any:
    """A function of tuples and numbers whose first argument is the law; raises TypeError, with both names, for a law
    that does not implement it.

    function.of(*kinds) and function.otherwise (for all other laws) register implementations, function.made_by what
    makes that of another type of laws; function.has(kind) tells whether a type of laws has its own,
    function.is_known_for(kind) whether it has any.
    """
    choices = _Choices(declaration.__name__)

    @functools.wraps(declaration)
    def function(law, *arguments):
        return choices.find(None if law is None else type(law))(law, *arguments)

    def choose(law, *arguments):
        return choices.find(_kind_of_type(law))

    overload(function, strict=False, jit_options=INLINED)(choose)

    def of(*kinds: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        def register(implementation: Callable[..., Any]) -> Callable[..., Any]:
            for kind in kinds:
                choices.of_kind[kind] = implementation
            return implementation

        return register

    def otherwise(implementation: Callable[..., Any]) -> Callable[..., Any]:
        choices.default = implementation
        return implementation

    def made_by(maker: Callable[[Any], Callable[..., Any]]) -> Callable[[Any], Callable[..., Any]]:
        choices.maker = maker
        return maker

    chosen: Any = function
    chosen.of, chosen.otherwise, chosen.made_by = of, otherwise, made_by
    chosen.has = lambda kind: kind in choices.of_kind
    chosen.is_known_for = lambda kind: choices.of_kind.get(kind, choices.default) is not None
    return chosen
