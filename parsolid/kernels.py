"""Compiled functions: numba's decorators with the options of this package, and where its cache is kept.

    @kernel      a compiled function with loops over particles, kept in numba's cache on disk
    @reduction   the same for sums that are reported and change no trajectory: they may be reordered, to be vectorised
    @inlined     a function that kernels call; it stays an ordinary Python function outside kernels

Inside kernels numba copies an inlined function into its caller before LLVM sees it: LLVM does not vectorise a loop
that still contains calls. Write x**0.5 rather than math.sqrt(x) in such loops, for the same reason, and take `exp`,
`log` and `power` from `parsolid.elementary`.
"""

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.extending import overload

# "contract": fused multiply-adds and no other reordering, so that results are reproducible
# error_model "numpy": no test for division by zero, whose branch would keep a loop from being vectorised
kernel = njit(cache=True, fastmath={"contract"}, error_model="numpy")
reduction = njit(cache=True, fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let kernels call a plain Python function, which numba copies into them."""
    overload(function, inline="always", strict=False)(lambda *arguments: function)
    return function
