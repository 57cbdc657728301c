"""Compiled functions: numba's decorators with the options of this package, and where its cache is kept.

    @kernel      a compiled function with loops over particles, kept in numba's cache on disk
    @reduction   the same for sums that are reported and change no trajectory: they may be reordered, to be vectorised
    @inlined     a function of tuples that kernels call; it stays an ordinary Python function outside kernels
    @scalar      the same of plain numbers, which compiles faster, and where numba drops the way of an `if part is
                 None` that is not taken

Inside kernels numba copies an inlined function into its caller before LLVM sees it: LLVM does not vectorise a loop
that still contains calls, and inlines functions of tuples too late. Functions of numbers it inlines in time. Write
x**0.5 rather than math.sqrt(x) in such loops, for the same reason, and take `exp`, `log` and `power` from
`parsolid.elementary`.
"""

import hashlib
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import config, njit
from numba.core.errors import NumbaIRAssumptionWarning
from numba.extending import overload

_ROOT = Path(__file__).parents[1]


def source_digest() -> str:
    """Digest of all Python files that kernels may be made of; numba alone looks at the file of the kernel only."""
    digest = hashlib.sha256()
    for package in ("decomposition", "parsolid"):
        for path in sorted((_ROOT / package).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Where compiled kernels of these sources are kept."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "parsolid" / f"numba-{source_digest()}"


config.CACHE_DIR = str(cache_folder())
# numba doubts values of `a if condition else b` in functions that it has copied into others, without harm
warnings.filterwarnings("ignore", category=NumbaIRAssumptionWarning)

# "contract": fused multiply-adds and no other reordering, so that results are reproducible
# error_model "numpy": no test for division by zero, whose branch would keep a loop from being vectorised
kernel = njit(cache=True, fastmath={"contract"}, error_model="numpy")
reduction = njit(cache=True, fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let kernels call a plain Python function, which numba copies into them."""
    overload(function, inline="always", strict=False)(lambda *arguments: function)
    return function


SCALAR_OPTIONS = {"fastmath": {"contract"}, "error_model": "numpy"}


def scalar(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let kernels call a plain Python function of numbers that returns a number."""
    overload(function, strict=False, jit_options=SCALAR_OPTIONS)(lambda *arguments: function)
    return function
