"""Functions that material laws implement, chosen by the type of the law: in kernels when they are compiled, else when
they are called.

    @law_function
    def flow_stress(law, plastic_strain, rate): "The flow stress [Pa]."

    @flow_stress.of(JohnsonCook)
    def johnson_cook(law, plastic_strain, rate):
        return law.yield_stress + ...

Laws are NamedTuples of their parameters. Their functions are plain arithmetic on numbers and on the tuples of
`parsolid.tensors`; kernels copy them in place of the call. A part that a law lacks is None, for which a function may
have an implementation too (`.of(None)`); `.of(Law, lacking="part")` is for laws of a type that lack a part. These are
chosen by type because numba compiles both ways of an `if part is None` in a function that it copies.
"""

import functools
from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import overload

from parsolid.kernels import INLINED


class _Choices:
    """Implementations of one function: (names of what the law lacks, implementation) by the type of the law."""

    def __init__(self, name: str):
        self.name = name
        self.default: Callable[..., Any] | None = None
        self.of_kind: dict[Any, list[tuple[frozenset[str], Callable[..., Any]]]] = {}

    def add(self, kind: Any, lacking: frozenset[str], implementation: Callable[..., Any]) -> None:
        same = [entry for entry in self.of_kind.get(kind, []) if entry[0] != lacking]
        self.of_kind[kind] = sorted([*same, (lacking, implementation)], key=lambda entry: -len(entry[0]))

    def find(self, kind: Any, absent: set[str]) -> Callable[..., Any]:
        for lacking, implementation in self.of_kind.get(kind, []):
            if lacking <= absent:
                return implementation
        if self.default is not None:
            return self.default
        known = ", ".join(sorted(_told(it) for it in self.of_kind))
        raise TypeError(f"{self.name} has no implementation for {_told(kind)}; it has those for {known}")


def _told(kind: Any) -> str:
    return "None" if kind is None else kind.__name__


def _kind_of_value(law: Any) -> tuple[Any, set[str]]:
    """The type of a law and the names of what it lacks."""
    if law is None:
        return None, set()
    return type(law), {name for name in getattr(law, "_fields", ()) if getattr(law, name) is None}


def _kind_of_type(law: Any) -> tuple[Any, set[str]]:
    """The same from numba's type of it."""
    if law is None or isinstance(law, types.NoneType):
        return None, set()
    if isinstance(law, types.BaseNamedTuple):
        absent = {name for name, kind in zip(law.fields, law.types) if isinstance(kind, types.NoneType)}
        return law.instance_class, absent
    return (tuple, set()) if isinstance(law, types.BaseTuple) else (float, set())


def law_function(declaration: Callable[..., Any]) -> Any:
    """A function of tuples and numbers whose first argument is the law; raises TypeError, with both names, for a law
    that does not implement it.

    function.of(*kinds, lacking="a b") and function.otherwise (for all other laws) register implementations;
    function.has(kind) tells whether a type of laws has its own.
    """
    choices = _Choices(declaration.__name__)

    @functools.wraps(declaration)
    def function(law, *arguments):
        return choices.find(*_kind_of_value(law))(law, *arguments)

    def choose(law, *arguments):
        return choices.find(*_kind_of_type(law))

    overload(function, strict=False, jit_options=INLINED)(choose)

    def of(*kinds: Any, lacking: str = "") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
        def register(implementation: Callable[..., Any]) -> Callable[..., Any]:
            for kind in kinds:
                choices.add(kind, frozenset(lacking.split()), implementation)
            return implementation

        return register

    def otherwise(implementation: Callable[..., Any]) -> Callable[..., Any]:
        choices.default = implementation
        return implementation

    chosen: Any = function
    chosen.of, chosen.otherwise, chosen.has = of, otherwise, lambda kind: kind in choices.of_kind
    return chosen
