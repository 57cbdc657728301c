"""Parts of numba's compiler that do their work over and over, done once; in force while a kernel is compiled.

Each gives what numba's gives. A quarter of the time of a compilation went into them: all registries looked through at
every call of a function, liveness found out after each pass, sums of two numbers typed by trying a dozen templates.
"""

import operator
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
from numba.core import base, ir, postproc, targetconfig, transforms, typeinfer, types
from numba.core.typing import context

_NUMBERS = (types.Float, types.Integer, types.Boolean, types.IntegerLiteral)
# what stands in numba's instructions beside variables
_NO_VARIABLES = frozenset((str, int, float, bool, type(None), ir.Loc, ir.Scope))


def _declared(registries: Any) -> int:
    """How much has been declared in registries, and how many modules there are that may declare more."""
    lists = (it for registry in registries for it in vars(registry).values() if isinstance(it, list))
    return len(sys.modules) + sum(map(len, lists))


def _refresh_once(refresh: Callable[[Any], None]) -> Callable[[Any], None]:
    """Look through the registries only where something has been declared since."""
    seen: dict[int, int] = {}

    def refresh_where_needed(self: Any) -> None:
        registries = self._registries
        if seen.get(id(registries)) != _declared(registries):
            refresh(self)
            seen[id(registries)] = _declared(registries)
        elif hasattr(self, "typing_context"):
            self.typing_context.refresh()

    return refresh_where_needed


def _without_liveness(run: Callable[..., None]) -> Callable[..., None]:
    """Find out how long variables live where they are deleted, which is before lowering."""

    def run_where_needed(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        function = self.func_ir
        if emit_dels or function.is_generator or function.func_id.modname.startswith("numba."):
            run(self, emit_dels=emit_dels, extend_lifetimes=extend_lifetimes)
        else:
            function.blocks = transforms.canonicalize_cfg(function.blocks)
            function.generator_info = None

    return run_where_needed


def _variables_quickly(usual: Callable[..., Any]) -> Callable[..., Any]:
    """The variables of an instruction, in the order of numba's."""

    def variables(self: Any, value: Any) -> Any:
        kind = value.__class__
        if kind is ir.Var:
            return [value]
        if kind is not dict and kind is not list and kind is not tuple:
            return [] if kind in _NO_VARIABLES else usual(self, value)
        found: list[Any] = []
        for one in value.values() if kind is dict else value:
            if one.__class__ is ir.Var:
                found.append(one)
            elif one.__class__ not in _NO_VARIABLES:
                found.extend(variables(self, one))
        return found

    return variables


def _equal_quickly(usual: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Flags are equal where the same were set to the same; else numba compares what they amount to."""

    def equal(self: Any, other: Any) -> Any:
        if type(self) is type(other) and self._values == other._values:
            return True
        return usual(self, other)

    return equal


def _operators_once(resolve: Callable[..., Any]) -> Callable[..., Any]:
    """Type an operator of numbers once for the same types."""
    known: dict[Any, tuple[Any, Any]] = {}

    def resolved(self: Any, typing_context: Any, arguments: Any, keywords: Any) -> Any:
        operator = getattr(self.key[0], "__module__", None) == "_operator" and not keywords
        if not operator or not all(type(kind) in _NUMBERS for kind in arguments):
            return resolve(self, typing_context, arguments, keywords)
        key = (id(self), tuple(arguments))
        if key not in known:
            # the type is kept, so that no other gets its id
            known[key] = (resolve(self, typing_context, arguments, keywords), self)
        return known[key][0]

    return resolved


def _names_in(value: Any) -> Iterator[str]:
    """Names of variables in the attributes of a constraint; also some that name no variable."""
    if isinstance(value, ir.Var):
        yield value.name
    elif isinstance(value, str):
        yield value
    elif isinstance(value, list | tuple):
        for one in value:
            yield from _names_in(one)
    elif isinstance(value, typeinfer.CallConstraint):
        yield from _names_in(list(vars(value).values()))


def _types_now(names: list[str], variables: Any) -> list[Any] | None:
    """Types that variables have so far; None where they do not decide what a constraint does."""
    found = [variables[name].type for name in names if name in variables]
    return None if any(isinstance(kind, types.RecursiveCall) for kind in found) else found


def _constraints_once(usual: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Apply a constraint again only where a type of one of its variables has changed since."""

    def propagate(self: Any, inferer: Any) -> Any:
        constraints, variables = self.constraints, inferer.typevars
        if "_seen" not in vars(self):
            self._seen = [(list(_names_in(list(vars(one).values()))), None) for one in constraints]
        errors: list[Any] = []
        for place, (names, known) in enumerate(self._seen):
            now = _types_now(names, variables)
            if known is not None and now is not None and len(now) == len(known) and all(map(operator.is_, now, known)):
                continue
            self.constraints = constraints[place : place + 1]
            wrong = usual(self, inferer)
            errors += wrong
            self._seen[place] = names, None if wrong else _types_now(names, variables)
        self.constraints = constraints
        return errors

    return propagate


_ECONOMIES: tuple[tuple[Any, str, Callable[..., Any]], ...] = (
    (base.BaseContext, "refresh", _refresh_once),
    (context.BaseContext, "refresh", _refresh_once),
    (postproc.PostProcessor, "run", _without_liveness),
    (ir.Inst, "_rec_list_vars", _variables_quickly),
    (targetconfig.TargetConfig, "__eq__", _equal_quickly),
    (types.BaseFunction, "get_call_type", _operators_once),
    (typeinfer.ConstraintNetwork, "propagate", _constraints_once),
)


@contextmanager
def replaced(parts: list[tuple[Any, str, Any]]) -> Iterator[list[tuple[Any, str, Any]]]:
    """While it is entered, attributes (owner, name, value) have other values; gives those that they had."""
    before = [(owner, name, getattr(owner, name)) for owner, name, _ in parts]
    try:
        for part in parts:
            setattr(*part)
        yield before
    finally:
        for part in before:
            setattr(*part)


def economies() -> list[tuple[Any, str, Any]]:
    """What of numba's compiler does its work in vain, and what does without, as (owner, name, value)."""
    quicker = [(owner, name, make(getattr(owner, name))) for owner, name, make in _ECONOMIES]
    # two events for each of a hundred thousand calls of LLVM
    return [*quicker, (llvm.ffi.lib._lock, "_cblist", [])]
