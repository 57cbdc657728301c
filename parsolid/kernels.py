"""Compiled functions: numba's decorators with the options of this package, kept on disk (`parsolid.kernel_cache`).

    @kernel      a compiled function with loops over particles, kept in numba's cache on disk
    @exact       the same without fused products and sums: two such kernels with one formula give the same bits
    @reduction   the same for sums that are reported and change no trajectory: they may be reordered, to be vectorised
    @inlined     a function of numbers and tuples that kernels call; elsewhere it stays an ordinary Python function

LLVM vectorises a loop only if no call is left in it. It inlines an @inlined function before it looks for loops, however
long the function is. Inside such a function an `if part is None` of an argument is decided when it is compiled. Write
x**0.5 rather than math.sqrt(x) in such loops, which would be a call, and take `exp`, `log` and `power` from
`parsolid.elementary`.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from numba import config, njit
from numba.core import event
from numba.extending import overload

from parsolid import kernel_cache

kernel_cache.set_up()
# "contract": fused multiply-adds and no other reordering, so that results are reproducible
# error_model "numpy": no test for division by zero, whose branch would keep a loop from being vectorised
# no_cfunc_wrapper: no second entry for C, which takes a tenth of the time of compiling and is never called
_COMMON = {"error_model": "numpy", "no_cfunc_wrapper": True}
kernel = njit(cache=True, fastmath={"contract"}, **_COMMON)
exact = njit(cache=True, **_COMMON)
reduction = njit(cache=True, fastmath={"contract", "reassoc", "nsz"}, **_COMMON)
INLINED = {"fastmath": {"contract"}, "forceinline": True, **_COMMON}


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let kernels call a plain Python function of numbers and tuples."""
    overload(function, strict=False, jit_options=INLINED)(lambda *arguments: function)
    return function


class _StraightLineVectors(event.Listener):  # type: ignore[misc]
    """Let LLVM make vectors of neighbouring operations in kernels, but not in inlined functions.

    These vectors are worth 1.25 times the speed of sweeps over pairs. In an inlined function they keep its tuples
    together and the loop that it is copied into from being vectorised, which costs a factor of two.
    """

    def __init__(self) -> None:
        self._outer: list[int] = []

    def on_start(self, event: Any) -> None:
        self._outer.append(config.SLP_VECTORIZE)
        config.SLP_VECTORIZE = int(not event.data["dispatcher"].targetoptions.get("forceinline", False))

    def on_end(self, event: Any) -> None:
        config.SLP_VECTORIZE = self._outer.pop()


event.register("numba:compile", _StraightLineVectors())


def aligned_zeros(shape: int | tuple[int, ...], dtype: Any = np.float64) -> np.ndarray:
    """A zeroed array whose first element lies on a 64-byte boundary: rows of four numbers stay within cache lines."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    buffer = np.zeros(size + 64, np.uint8)
    offset = -buffer.ctypes.data % 64
    return buffer[offset : offset + size].view(dtype).reshape(shape)


class _Outermost(event.Listener):  # type: ignore[misc]
    """Hears of kernels whose compilation begins, not of functions that are compiled on their behalf."""

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell, self._depth = tell, 0

    def on_start(self, event: Any) -> None:
        if self._depth == 0:
            self._tell(event.data["dispatcher"].py_func.__name__)
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1


def on_compile(tell: Callable[[str], object]) -> AbstractContextManager[Any]:
    """While it is entered, `tell` is called with the name of every kernel that this process begins to compile."""
    return event.install_listener("numba:compile", _Outermost(tell))
