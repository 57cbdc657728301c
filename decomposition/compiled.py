"""`@compiled`, the former name of numba's decorator with its cache on disk; goes with the last kernel that uses it."""

import functools
from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """`numba.njit(cache=True)` with options of `njit`."""
    if function is None:
        return functools.partial(compiled, **options)
    return njit(cache=True, **options)(function)
