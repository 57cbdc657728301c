"""`@compiled`: numba functions whose machine code is kept in files, found by what it was compiled from.

numba's own cache looks at the file of the function alone: it does not see a change in what that calls, and two
processes that save at once can mix up its index. Here a file is named by a digest of the function, its argument types,
the processor, and the text of every module of the function's own project that it can reach: those it imports, and those
of the argument types (a law given as an argument), with all that they import. So an edited law recompiles what calls
that law and nothing else; ranks, processes and checkouts share one folder.

What is in a file is called without numba (`file_kernels`), which is imported when something has to be compiled
(`kernel_cache`).
"""

import functools
import os
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from decomposition.deferred import numba_is_there
from decomposition.kernel_places import folder

__all__ = ["LISTENERS", "PLAIN_ASKED", "WAY", "compiled", "folder", "ordered"]

# told the name of every kernel that this process begins to compile
LISTENERS: list[Callable[[str], object]] = []
# a number that goes up where the machine code of `compilation` changes
WAY = 5
PLAIN_ASKED = bool(os.environ.get("PARSOLID_PLAIN_COMPILER"))
# what of numba's settings changes no machine code; NUMBA_SLP_VECTORIZE is looked at
_HARMLESS = frozenset(("NUMBA_CACHE_DIR", "NUMBA_SLP_VECTORIZE", "NUMBA_NUM_THREADS", "NUMBA_THREADING_LAYER"))


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """`numba.njit` with the cache of this module; used as `@compiled` or with options of `njit`,
    `@compiled(error_model="numpy")`.
    """
    if function is None:
        return functools.partial(compiled, **options)
    options = {"no_cfunc_wrapper": True, **options}
    kernel = None if numba_is_there() else _file_kernel()
    if kernel is not None:
        return kernel(function, options)
    from decomposition.kernel_cache import numba_kernel

    return numba_kernel(function, options)


@functools.cache
def _file_kernel() -> Any:
    """The class of kernels that need no numba; None where numba is set, or built, in another way than usual."""
    set_otherwise = any(name.startswith("NUMBA_") and name not in _HARMLESS for name in os.environ)
    if set_otherwise or PLAIN_ASKED or os.path.exists(".numba_config.yaml"):
        return None
    with suppress(Exception):
        int(os.environ.get("NUMBA_SLP_VECTORIZE", "0"))
        from decomposition.file_kernels import FileKernel

        # as every other is made; a numba that is built otherwise may want it in another way
        FileKernel(ordered, {})
        return FileKernel
    return None


def ordered(options: dict[str, Any]) -> list[tuple[str, Any]]:
    """Options of a kernel in an order that is the same in every process; sets of words have none."""
    return [(name, sorted(it) if isinstance(it, set | frozenset) else it) for name, it in sorted(options.items())]
