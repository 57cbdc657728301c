"""`@compiled`: numba functions whose machine code is kept in files, found by what it was compiled from.

numba's own cache looks at the file of the function alone: it does not see a change in what that calls, and two
processes that save at once can mix up its index. Here a file is named by a digest of the function, its argument types,
the processor, and the text of every module of the function's own project that it can reach: those it imports, and those
of the argument types (a law given as an argument), with all that they import. So an edited law recompiles what calls
that law and nothing else; ranks, processes and checkouts share one folder.
"""

import fcntl
import functools
import hashlib
import os
import pickle
import re
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba import __version__ as numba_version
from numba import njit
from numba.core import config, extending
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.core.types import BaseNamedTuple, BaseTuple, Optional  # type: ignore[attr-defined]

try:
    from decomposition.compilation import FALLEN_BACK, compile_short
except (ImportError, AttributeError):
    # a numba that is built otherwise
    FALLEN_BACK, compile_short = [], None  # type: ignore[assignment]

# numba may have been imported before what NUMBA_... says was set
config.reload_config()

_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([\w., \t]+))", re.MULTILINE
)
# how kernels are compiled: numba's own way, or a number that goes up where the machine code of `compilation` changes
PLAIN = compile_short is None or bool(os.environ.get("PARSOLID_PLAIN_COMPILER"))
_WAY = "numba" if PLAIN else 2
_OURS = ("parsolid", "decomposition")
# nobody calls these kernels, or what they call, from C: without those entry points compilation takes a seventh less
getattr(extending, "_overload_default_jit_options", {}).setdefault("no_cfunc_wrapper", True)
# files that nothing has asked for in so many seconds are removed; a use is noted once a day
_KEPT, _NOTED = 90 * 86400.0, 86400.0
# how long a process waits for another that compiles the same function, and how often it looks, in seconds
_PATIENCE, _GLANCE = 600.0, 0.02


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """`numba.njit` with the cache of this module; used as `@compiled` or with options of `njit`,
    `@compiled(error_model="numpy")`.
    """
    if function is None:
        return functools.partial(compiled, **options)
    options = {"no_cfunc_wrapper": True, **options}
    dispatcher = njit(**options)(function)
    if not config.DISABLE_JIT:
        dispatcher._cache = KernelCache(function, options)
        dispatcher._can_cache = True
        # numba calls nothing of a cache when a compilation fails
        dispatcher.compile = functools.partial(_compile, dispatcher, dispatcher.compile)
    return dispatcher


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


@functools.cache
def folder() -> Path:
    """Where compiled kernels are kept: $NUMBA_CACHE_DIR, else parsolid/kernels in the user's cache folder, else a
    temporary one.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    usual = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "parsolid" / "kernels"
    # one for all ranks and runs of a user on this machine
    for path in (Path(chosen) if chosen else usual, Path(tempfile.gettempdir()) / f"parsolid-kernels-{os.getuid()}"):
        with suppress(OSError):
            path.mkdir(parents=True, exist_ok=True)
            if os.access(path, os.W_OK):
                return path
    return Path(tempfile.mkdtemp(prefix="parsolid-kernels-"))


@functools.cache
def _text(module: str) -> tuple[bytes, tuple[str, ...]]:
    """A module's source and the modules of its project that it imports; nothing of other projects."""
    path = _source(module)
    if path is None:
        return b"", ()
    text = path.read_bytes()
    return text, tuple(sorted(_imported(module, text.decode())))


def _source(module: str) -> Path | None:
    loaded = sys.modules.get(module)
    if loaded is not None and getattr(loaded, "__file__", None):
        path = Path(str(loaded.__file__))
        return path if path.suffix == ".py" and path.exists() else None
    # not loaded: beside the modules of the same package
    top, *rest = module.split(".")
    package = sys.modules.get(top)
    for root in getattr(package, "__path__", ()):
        path = Path(root, *rest)
        for candidate in (path.with_suffix(".py"), path / "__init__.py"):
            if rest and candidate.is_file():
                return candidate
    return None


def _imported(module: str, text: str) -> set[str]:
    """Names of modules that a text imports, of this project or beside the module itself."""
    found: set[str] = set()
    for start, names, plain in _IMPORT.findall(text):
        if start:
            parts = [name.split()[0] for name in re.sub(r"#[^\n]*|[()\\]", " ", names).split(",") if name.strip()]
            modules = {f"{start}.{name}" for name in parts if _is_ours(f"{start}.{name}", module)}
            found |= modules if len(modules) == len(parts) else modules | {start}
        else:
            found |= {name.split()[0] for name in plain.split(",") if name.strip()}
    return {name for name in found if name != module and _is_ours(name, module)}


def _is_ours(name: str, importer: str) -> bool:
    source, here = _source(name), _source(importer)
    return source is not None and (
        name.partition(".")[0] in _OURS or (here is not None and source.parent == here.parent)
    )


@functools.cache
def reached(module: str) -> frozenset[str]:
    """A module and all that it imports of its project, directly or not."""
    found, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        # how kernels are kept says nothing of what they do
        if name not in found and name != __name__:
            found.add(name)
            waiting += _text(name)[1]
    return frozenset(found)


@functools.cache
def _digest(module: str) -> bytes:
    digest = hashlib.sha256()
    for name in sorted(reached(module)):
        digest.update(name.encode() + b"\0" + _text(name)[0] + b"\0")
    return digest.digest()


def _modules_of(kind: Any) -> set[str]:
    """Modules of the classes in an argument type, whose functions a kernel may have compiled in."""
    if isinstance(kind, BaseNamedTuple):
        inner = set().union(*map(_modules_of, kind.types)) if kind.types else set()
        return {kind.instance_class.__module__} | inner
    if isinstance(kind, BaseTuple):
        return set().union(*map(_modules_of, kind)) if len(kind) else set()
    if isinstance(kind, Optional):
        return _modules_of(kind.type)
    return set()


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
    file = _lock_file(folder())
    if file is not None:
        with suppress(OSError):
            fcntl.lockf(file, fcntl.LOCK_UN, 1, place)


# told the name of every kernel that this process begins to compile
LISTENERS: list[Callable[[str], object]] = []


class KernelCache(_Cache):  # type: ignore[misc]
    """The files of one function's machine code, one for each signature."""

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        self.function, self.enabled = function, True
        # sets of words have another order in another process
        self.options = [
            (name, sorted(it) if isinstance(it, set | frozenset) else it) for name, it in sorted(options.items())
        ]

    @property
    def cache_path(self) -> str:
        """The folder that all kernels share."""
        return str(folder())

    def enable(self) -> None:
        """Use the files."""
        self.enabled = True

    def disable(self) -> None:
        """Compile anew."""
        self.enabled = False

    def flush(self) -> None:
        """Nothing: a file never becomes wrong."""

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """The compiled function of a signature, waiting for a process that compiles it; None for this one to compile
        it.
        """
        if not self.enabled:
            return None
        # all that a loaded function needs; refresh(), for compilations, takes as long as the rest of numba
        rtsys.initialize(target_context)
        path = self.path(sig, target_context.codegen())
        found = _load(path, target_context)
        # the file may have come between the look and the reservation
        if found is None and (_reserve(path) or path.exists()):
            found = _load(path, target_context)
        for listener in LISTENERS if found is None else ():
            listener(self.function.__name__)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled; a folder that is full or not writable only costs time."""
        if not self.enabled or data.lifted or data.library.has_dynamic_globals:
            return
        path, payload = self.path(sig, data.codegen), dumps(data._reduce())
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".new-", delete=False) as file:
                file.write(hashlib.sha256(payload).digest() + payload)
            os.replace(file.name, path)
            _forget_unused(path.parent)

    def path(self, sig: Any, codegen: Any) -> Path:
        """The file of a signature."""
        function = self.function
        code, digest = function.__code__, hashlib.sha256()
        modules = {function.__module__}.union(*map(_modules_of, sig))
        cells = tuple(cell.cell_contents for cell in function.__closure__ or ())
        what = (
            function.__qualname__,
            code.co_firstlineno,
            code.co_code,
            str(sig),
            codegen.magic_tuple(),
            self.options,
            numba_version,
            _WAY,
        )
        numbas = config.SLP_VECTORIZE, config.OPT, config.BOUNDSCHECK
        digest.update(repr((*what, sys.version_info[:2], *numbas)).encode())
        digest.update(dumps(cells) if cells else b"")
        for module in sorted(modules):
            digest.update(_digest(module))
        return (
            folder() / f"{function.__module__.rpartition('.')[2]}.{function.__name__}-{digest.hexdigest()[:32]}.kernel"
        )


def _load(path: Path, target_context: Any) -> CompileResult | None:
    # a file that cannot be read is as good as none
    with suppress(OSError, EOFError, pickle.UnpicklingError, ValueError):
        content = path.read_bytes()
        if time.time() - path.stat().st_mtime > _NOTED:
            os.utime(path)
        checksum, payload = content[:32], content[32:]
        if hashlib.sha256(payload).digest() == checksum:
            return CompileResult._rebuild(target_context, *pickle.loads(payload))
    return None


@functools.cache
def _forget_unused(where: Path) -> None:
    """Remove old files, once in a process."""
    now = time.time()
    for path in where.glob("*.kernel"):
        with suppress(OSError):
            if now - path.stat().st_mtime > _KEPT:
                path.unlink()
