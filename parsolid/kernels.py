"""Compiled functions: numba's decorators with the options of this package, kept on disk (`parsolid.kernel_cache`).

    @kernel      a compiled function with loops over particles, kept in numba's cache on disk
    @exact       the same without fused products and sums: two such kernels with one formula give the same bits
    @reduction   the same for sums that are reported and change no trajectory: they may be reordered, to be vectorised
    @inlined     a function of tuples that kernels call; it stays an ordinary Python function outside kernels
    @scalar      the same of plain numbers, which compiles faster, and where numba drops the way of an `if part is
                 None` that is not taken

Inside kernels numba copies an inlined function into its caller before LLVM sees it: LLVM does not vectorise a loop
that still contains calls, and inlines functions of tuples too late. Functions of numbers it inlines in time. Write
x**0.5 rather than math.sqrt(x) in such loops, for the same reason, and take `exp`, `log` and `power` from
`parsolid.elementary`.
"""

import os
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from numba import config, njit
from numba.core import event
from numba.core.errors import NumbaIRAssumptionWarning
from numba.extending import overload

from parsolid import kernel_cache

kernel_cache.set_up()
# worth 1.25x on sweeps over pairs
if "NUMBA_SLP_VECTORIZE" not in os.environ:
    config.SLP_VECTORIZE = 1
# numba doubts values of `a if condition else b` in functions that it has copied into others, without harm
warnings.filterwarnings("ignore", category=NumbaIRAssumptionWarning)

# "contract": fused multiply-adds and no other reordering, so that results are reproducible
# error_model "numpy": no test for division by zero, whose branch would keep a loop from being vectorised
kernel = njit(cache=True, fastmath={"contract"}, error_model="numpy")
exact = njit(cache=True, error_model="numpy")
reduction = njit(cache=True, fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let kernels call a plain Python function, which numba copies into them."""
    overload(function, inline="always", strict=False)(lambda *arguments: function)
    return function


# LLVM inlines what has this mark before it vectorises, however long it is; functions of tuples it has spoilt by then
SCALAR_OPTIONS = {"fastmath": {"contract"}, "error_model": "numpy", "forceinline": True}


def scalar(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let kernels call a plain Python function of numbers that returns a number."""
    overload(function, strict=False, jit_options=SCALAR_OPTIONS)(lambda *arguments: function)
    return function


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
