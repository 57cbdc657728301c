"""`Recalled`, a kernel that is called directly; goes with the last module that uses it."""

from collections.abc import Callable
from typing import Any


class Recalled:
    """A kernel."""

    def __init__(self, kernel: Callable[..., Any], free: tuple[int, ...] = ()) -> None:
        self.kernel = kernel

    def __call__(self, *arguments: Any) -> Any:
        """What the kernel returns."""
        return self.kernel(*arguments)


class RecalledEach(Recalled):
    """A kernel that is called in turn for several things."""

    def __call__(self, key: Any, *arguments: Any) -> Any:
        """What the kernel returns."""
        return self.kernel(*arguments)
