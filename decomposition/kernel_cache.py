"""Kernels of numba's with files (`compiled`): one process compiles what others wait for."""

import fcntl
import functools
import os
import tempfile
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import config
from numba.core.caching import _Cache
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import OmittedArg
from numba.core.types import Omitted  # type: ignore[attr-defined]

from decomposition import kernel_places
from decomposition.compiled import LISTENERS, PLAIN_ASKED, WAY, ordered
from decomposition.kernel_files import UNREADABLE
from decomposition.kernel_sources import KEEPERS, classes_of, covered, is_followed
from decomposition.loaded_kernels import LoadedKernel, content

try:
    from decomposition.compilation import FALLEN_BACK, compile_short
except (ImportError, AttributeError):
    # a numba that is built otherwise
    FALLEN_BACK, compile_short = [], None  # type: ignore[assignment]

# numba may have been imported before what NUMBA_... says was set
config.reload_config()

# how kernels are compiled
PLAIN = compile_short is None or PLAIN_ASKED
_WAY = "numba" if PLAIN else WAY
# files that nothing has asked for in so many seconds are removed
_KEPT = 90 * 86400.0
# nobody is still writing a file that is so many seconds old
_WRITTEN = 86400.0
# how long a process waits for another that compiles the same function, and how often it looks, in seconds
_PATIENCE, _GLANCE = 600.0, 0.02


def numba_kernel(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """numba's dispatcher of a function, with files; options: of `njit`."""
    dispatcher = njit(**options)(function)
    if not config.DISABLE_JIT:
        dispatcher._cache = KernelCache(function, options)
        dispatcher._can_cache = True
        # numba calls nothing of a cache when a compilation fails
        dispatcher.compile = functools.partial(_compile, dispatcher, dispatcher.compile)
        dispatcher._compile_for_args = functools.partial(_first_call, dispatcher, dispatcher._compile_for_args)
    return dispatcher


def _first_call(dispatcher: Any, as_numba: Callable[..., Any], *arguments: Any, **keywords: Any) -> Any:
    """What Python calls for arguments of these types: from a file, without a part of numba's compiler being loaded, or
    as numba finds it.
    """
    kinds = tuple(Omitted(it.value) if isinstance(it, OmittedArg) else dispatcher.typeof_pyval(it) for it in arguments)
    with global_compiler_lock:
        known = kinds in dispatcher.overloads
        found = None if known or keywords else dispatcher._cache.load_overload(kinds, dispatcher.targetctx, wait=False)
        if found is None:
            return as_numba(*arguments, **keywords)
        dispatcher._types_active_call.clear()
        dispatcher._cache_hits[kinds] += 1
        dispatcher._insert([kind._code for kind in kinds], found.entry_point, False)
        dispatcher.overloads[kinds] = found
        return found.entry_point


def _compile(dispatcher: Any, as_numba: Callable[[Any], Any], signature: Any) -> Any:
    """Compile, or wait for the process that does; what was reserved is free again afterwards, also after an error."""
    with global_compiler_lock:
        before = len(_RESERVED)
        try:
            return as_numba(signature) if PLAIN else compile_short(dispatcher, as_numba, signature)
        finally:
            for place in _RESERVED[before:]:
                _release(place)
            del _RESERVED[before:]


# places in the lock file that this process holds, in the order of the compilations that stand within each other
_RESERVED: list[int] = []


@functools.cache
def _lock_file(where: Path) -> int | None:
    """The one file whose bytes stand for the kernels of a folder; None where it cannot be had."""
    with suppress(OSError):
        return os.open(where / "lock", os.O_RDWR | os.O_CREAT, 0o666)
    return None


def _reserve(path: Path) -> bool:
    """Reserve a kernel for this process to compile; True where another process had it, so that its file may be there by
    now.

    A process that dies frees what it had, for these are locks of the system. A kernel never calls one that calls it, so
    no two processes wait for each other; were it so all the same, they go on after a while and compile both.
    """
    place, file = int(path.stem[-32:][:12], 16), _lock_file(path.parent)
    if file is None or place in _RESERVED:
        return False
    waited, end = False, time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        try:
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
        except (BlockingIOError, PermissionError):
            waited = True
            time.sleep(_GLANCE)
        except OSError:
            # a file system without locks
            return waited
        else:
            _RESERVED.append(place)
            return waited
    return waited


def _release(place: int) -> None:
    file = _lock_file(kernel_places.folder())
    if file is not None:
        with suppress(OSError):
            fcntl.lockf(file, fcntl.LOCK_UN, 1, place)


class KernelCache(_Cache):  # type: ignore[misc]
    """The files of one function's machine code, one for each signature."""

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        self.function, self.enabled, self._stated = function, True, options
        self.options = ordered(options)

    @property
    def cache_path(self) -> str:
        """The folder that all kernels share."""
        return str(kernel_places.folder())

    def enable(self) -> None:
        """Use the files."""
        self.enabled = True

    def disable(self) -> None:
        """Compile anew."""
        self.enabled = False

    def flush(self) -> None:
        """Nothing: a file never becomes wrong."""

    def load_overload(self, sig: Any, target_context: Any, wait: bool = True) -> LoadedKernel | None:
        """The compiled function of a signature, waiting for a process that compiles it unless told not to; None for
        this one to compile it.
        """
        if not self.enabled:
            return None
        path = self.path(sig, target_context.codegen())
        found = self._load(path, sig, target_context)
        if not wait:
            return found
        # the file may have come between the look and the reservation
        if found is None and (_reserve(path) or path.exists()):
            found = self._load(path, sig, target_context)
        for listener in LISTENERS if found is None else ():
            listener(self.function.__name__)
        return found

    def _load(self, path: Path, sig: Any, target_context: Any) -> LoadedKernel | None:
        # a file that cannot be read is as good as none
        with suppress(*UNREADABLE):
            kernel_places.note_use(path)
            return LoadedKernel(path, target_context, functools.partial(self._compile_again, sig))
        return None

    def _compile_again(self, sig: Any) -> Any:
        dispatcher = numba_kernel(self.function, self._stated)
        dispatcher._cache.disable()
        dispatcher.compile(sig)
        return dispatcher.overloads[tuple(sig)]

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled; a folder that is full or not writable only costs time."""
        if not self.enabled or data.lifted or data.library.has_dynamic_globals:
            return
        path = self.path(sig, data.codegen)
        if strangers := self._strangers(sig, data):
            told = f"{self.function.__module__}.{self.function.__name__} is compiled at every start"
            warnings.warn(f"{told}: its file would not follow {', '.join(strangers)}", stacklevel=2)
            return
        with suppress(*UNREADABLE):
            payload = content(data)
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".new-", delete=False) as file:
                file.write(payload)
            os.replace(file.name, path)
            _forget_unused(path.parent)

    def _strangers(self, sig: Any, data: Any) -> list[str]:
        """Modules with functions compiled in whose text the file would not be named by."""
        classes = frozenset(it for kind in sig for it in classes_of(kind))
        names = {environment.globals.get("__name__") for environment in data._find_referenced_environments()}
        known = covered(kernel_places.modules_of(self.function), classes) | {None, *KEEPERS}
        return sorted(it for it in names - known if is_followed(it))

    def path(self, sig: Any, codegen: Any) -> Path:
        """The file of a signature."""
        numbas = int(config.SLP_VECTORIZE), int(config.OPT), config.BOUNDSCHECK
        classes = tuple(it for kind in sig for it in classes_of(kind))
        way = (*codegen.magic_tuple(), _WAY, *numbas)
        return kernel_places.path_of(self.function, self.options, [str(kind) for kind in sig], classes, way)


@functools.cache
def _forget_unused(where: Path) -> None:
    """Remove old files, and what a writer that was killed has left, once in a process."""
    now = time.time()
    for pattern, kept in (("*.kernel", _KEPT), (".new-*", _WRITTEN)):
        for path in where.glob(pattern):
            with suppress(OSError):
                if now - path.stat().st_mtime > kept:
                    path.unlink()
