"""What numba is told only when it is there: a job whose kernels come from files runs without it.

What kernels call is declared where it stands, as with numba's own decorators; the declarations wait until numba is
imported, by the first kernel that must be compiled or by anybody else, and are made at once from then on.
"""

import importlib
import sys
from collections.abc import Callable, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

_WAITING: list[Callable[[], object]] = []


def numba_is_there() -> bool:
    """Whether numba is imported, wholly."""
    return hasattr(sys.modules.get("numba"), "njit")


def with_numba(action: Callable[[], object]) -> None:
    """Do something once numba is imported: now, where it is."""
    if numba_is_there():
        action()
    else:
        _WAITING.append(action)


def _without_entry_points_for_c() -> None:
    """Nobody calls what kernels call from C: without those entry points compilation takes a seventh less."""
    from numba.core import extending

    getattr(extending, "_overload_default_jit_options", {}).setdefault("no_cfunc_wrapper", True)


with_numba(_without_entry_points_for_c)


def _make_up() -> None:
    """Do all that waits."""
    while _WAITING:
        _WAITING.pop(0)()


class _Watcher(MetaPathFinder, Loader):
    """Makes up for what waits when anybody imports numba."""

    def __init__(self) -> None:
        self._loader: Any = None

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The module as it is found without this, to be loaded by this."""
        if fullname != "numba":
            return None
        spec = PathFinder.find_spec(fullname)
        if spec is not None and spec.loader is not None:
            self._loader, spec.loader = spec.loader, self
        return spec

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        """As it is made without this."""
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        """Load it; then do what waits."""
        spec: Any = module.__spec__
        spec.loader = module.__loader__ = self._loader
        sys.meta_path.remove(self)
        self._loader.exec_module(module)
        _make_up()


if not numba_is_there():
    sys.meta_path.insert(0, _Watcher())


def register_jitable(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """`numba.extending.register_jitable`."""
    if function is None:
        return lambda function: register_jitable(function, **options)

    def declare() -> None:
        from numba.extending import register_jitable as now

        declared = now(**options)(function) if options else now(function)
        assert declared is function

    with_numba(declare)
    return function


def overload(function: Callable[..., Any], **options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """`numba.extending.overload`."""

    def declared(choose: Callable[..., Any]) -> Callable[..., Any]:
        def declare() -> None:
            from numba.extending import overload as now

            now(function, **options)(choose)

        with_numba(declare)
        return choose

    return declared


class Deferred:
    """What only kernels can call, such as an intrinsic, made when one that calls it is compiled."""

    def __init__(self, make: Callable[[], Any]) -> None:
        """make: gives what numba knows."""
        self._make = make

    def __call__(self, *arguments: Any) -> Any:
        """Plain Python, as with NUMBA_DISABLE_JIT, has none."""
        raise NotImplementedError("this is for compiled kernels alone, found a call of it from plain Python")

    @property
    def _numba_type_(self) -> Any:
        """What numba asks of things that it does not know."""
        from numba.core.registry import cpu_target

        if "real" not in vars(self):
            self.real = self._make()
            # what is declared in the midst of a compilation
            cpu_target.typing_context.refresh()
            cpu_target.target_context.refresh()
        return cpu_target.typing_context.resolve_value_type(self.real)


class Elsewhere:
    """A module of what only kernels can call, imported with the first that is compiled; its names as attributes."""

    def __init__(self, module: str) -> None:
        self._module = module

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Deferred(lambda: getattr(importlib.import_module(self._module), name))
