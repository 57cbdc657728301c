"""Where compiled kernels are kept, and by what their files are named: a digest of all that the machine code follows
from. The same with numba and without.
"""

import functools
import hashlib
import os
import pickle
import runpy
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

from decomposition.kernel_sources import ClassName, digest_of

# a use of a file is noted once a day, in seconds
_NOTED = 86400.0


def wanted_folder() -> Path:
    """Where compiled kernels are to be kept: $NUMBA_CACHE_DIR, else parsolid/kernels in the user's cache folder."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return Path(chosen)
    # in a container a user may have no home
    with suppress(RuntimeError):
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "parsolid" / "kernels"
    return _temporary()


def _is_own(path: Path) -> bool:
    about = path.lstat()
    return stat.S_ISDIR(about.st_mode) and about.st_uid == os.getuid() and not about.st_mode & stat.S_IWOTH


def _temporary() -> Path:
    return Path(tempfile.gettempdir()) / f"parsolid-kernels-{os.getuid()}"


@functools.cache
def folder() -> Path:
    """Where compiled kernels are kept: where they are wanted, else in a temporary folder."""
    # one for all ranks and runs of a user on this machine
    for path in (wanted_folder(), _temporary()):
        with suppress(OSError):
            path.mkdir(parents=True, exist_ok=True)
            # what is in a file is run: not what anybody has put where all may write
            if os.access(path, os.W_OK) and (path != _temporary() or _is_own(path)):
                return path
    return Path(tempfile.mkdtemp(prefix="parsolid-kernels-"))


@functools.cache
def numba_folder() -> Path:
    """Where numba is installed, which need not be imported for that. Raises ModuleNotFoundError."""
    spec = PathFinder.find_spec("numba")
    loaded = sys.modules.get("numba")
    if spec is None or not spec.origin:
        if loaded is None or not loaded.__file__:
            raise ModuleNotFoundError("numba")
        return Path(loaded.__file__).parent
    return Path(spec.origin).parent


@functools.cache
def numba_version() -> str:
    """numba's version, which need not be imported for that."""
    with suppress(Exception):
        names = runpy.run_path(str(numba_folder() / "_version.py"))
        return str(names["get_versions"]()["version"])
    import numba

    return str(numba.__version__)


def modules_of(function: Callable[..., Any]) -> frozenset[str]:
    """The module of a function, and those of functions in its closure, which are pickled by their names alone."""
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    held = {str(cell.__module__) for cell in cells if callable(cell) and cell.__module__}
    return frozenset({function.__module__, *held})


def path_of(
    function: Callable[..., Any],
    options: list[tuple[str, Any]],
    types: list[str],
    classes: tuple[ClassName, ...],
    way: tuple[Any, ...],
) -> Path:
    """The file of a function's machine code for the named types of arguments.

    classes: those in the types, in order; way: the processor and how numba is set.
    """
    code, digest = function.__code__, hashlib.sha256()
    cells = tuple(cell.cell_contents for cell in function.__closure__ or ())
    what = (
        function.__qualname__,
        code.co_firstlineno,
        code.co_code,
        types,
        classes,
        options,
        way,
        sys.version_info[:2],
    )
    digest.update(repr(what).encode())
    digest.update(numba_version().encode())
    digest.update(_pickled(cells) if cells else b"")
    digest.update(digest_of(modules_of(function), frozenset(classes)))
    return folder() / f"{function.__module__.rpartition('.')[2]}.{function.__name__}-{digest.hexdigest()[:32]}.kernel"


def _pickled(cells: tuple[Any, ...]) -> bytes:
    with suppress(Exception):
        return pickle.dumps(cells, protocol=4)
    # functions made by functions, which numba can pickle
    from numba.core.serialize import dumps

    return bytes(dumps(cells))


def note_use(path: Path) -> None:
    """Files that nothing asks for are removed after a while. Raises OSError where there is none."""
    if time.time() - path.stat().st_mtime > _NOTED:
        os.utime(path)
