"""Kernels that are called again and again with the same objects.

numba looks at the type of every argument, and of all that is in it, at every call; where arguments are tuples of arrays
this takes longer than a call over a few hundred particles does.
"""

from collections.abc import Callable
from operator import is_not, itemgetter
from typing import Any


def entry_point(kernel: Any, arguments: tuple[Any, ...]) -> Callable[..., Any] | None:
    """The machine code for the types of arguments, which a kernel has been called with; None where there is none."""
    ask = getattr(type(kernel), "entry_point", None)
    if ask is not None:
        return ask(kernel, arguments)
    known: dict[Any, Any] = getattr(kernel, "overloads", {})
    if not known:
        return None
    from numba import typeof

    found = known.get(tuple(typeof(argument) for argument in arguments))
    return None if found is None else found.entry_point


class Recalled:
    """A compiled function whose machine code is looked up anew only when other objects are given than the last time.

    free: positions of arguments that are other objects at every call, but always of the same types, in all that is in
    them: numbers, and named tuples of numbers and arrays. Nothing checks that; all others, two at least, are compared.
    """

    def __init__(self, kernel: Callable[..., Any], free: tuple[int, ...] = ()) -> None:
        self.kernel, self.free = kernel, free
        self._fixed: Callable[[tuple[Any, ...]], Any] = tuple
        self._last: tuple[Any, ...] | None = None
        self._code: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """What the kernel returns."""
        if self._last is not None and not any(map(is_not, self._fixed(arguments), self._last)):
            return (self._code or self._look_up(arguments))(*arguments)
        if self._last is None and self.free:
            # at least two are left, so that a tuple is got
            self._fixed = itemgetter(*(k for k in range(len(arguments)) if k not in self.free))
        # objects that come once only are numba's affair
        self._last, self._code = self._fixed(arguments), None
        return self.kernel(*arguments)

    def _look_up(self, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """The machine code for the types of the arguments, which the kernel has been called with."""
        self._code = entry_point(self.kernel, arguments) or self.kernel
        return self._code


class RecalledEach:
    """A compiled function that is called in turn for several things, such as lists of pairs or materials."""

    def __init__(self, kernel: Callable[..., Any], free: tuple[int, ...] = ()) -> None:
        """See `Recalled`."""
        self.kernel, self.free = kernel, free
        self._of: dict[Any, Recalled] = {}

    def __call__(self, key: Any, *arguments: Any) -> Any:
        """What the kernel returns; key: of the thing."""
        found = self._of.get(key)
        if found is None:
            found = self._of[key] = Recalled(self.kernel, self.free)
        return found(*arguments)
