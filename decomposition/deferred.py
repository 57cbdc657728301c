"""Former names of numba's decorators; goes with the last module that uses them."""

import importlib
from collections.abc import Callable
from typing import Any

from numba.extending import overload, register_jitable

__all__ = ["Deferred", "Elsewhere", "overload", "register_jitable", "with_numba"]


def with_numba(action: Callable[[], object]) -> None:
    """Do something now."""
    action()


class Deferred:
    """What only kernels can call, such as an intrinsic, made when one that calls it is compiled."""

    def __init__(self, make: Callable[[], Any]) -> None:
        """make: gives what numba knows."""
        self._make = make

    def __call__(self, *arguments: Any) -> Any:
        """Plain Python has none."""
        raise NotImplementedError("this is for compiled kernels alone, found a call of it from plain Python")

    @property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target

        if "real" not in vars(self):
            self.real = self._make()
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
