"""Where numba keeps the compiled kernels of this package: in a folder named by a digest of all their sources.

numba's own cache looks at the file of a kernel alone, and not at those of the functions that it calls.
"""

import fcntl
import glob
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import config
from numba.extending import is_jitted

PACKAGES = ("decomposition", "parsolid")
# parts of this package that define no kernels: an edit there recompiles nothing
WITHOUT_KERNELS = (
    "api",
    "campaign",
    "commands",
    "exact",
    "launcher.py",
    "observables",
    "output",
    "scene",
    "simulation",
)
_KEPT_DAYS, _KEPT_FOLDERS = 30, 20


@cache
def source_digest() -> str:
    """Digest of the sources of kernels and of numba's settings; numba itself looks at the file of a kernel alone."""
    root, digest = Path(__file__).parents[1], hashlib.sha256()
    for path in sorted(path for package in PACKAGES for path in (root / package).rglob("*.py")):
        parts = path.relative_to(root).parts
        if parts[1] not in WITHOUT_KERNELS:
            digest.update("/".join(parts).encode() + b"\0" + path.read_bytes())
    without_effect = ("NUMBA_CACHE_DIR", "NUMBA_NUM_THREADS", "NUMBA_THREADING_LAYER")
    settings = {name: text for name, text in os.environ.items() if name.startswith("NUMBA_")}
    digest.update(repr(sorted(item for item in settings.items() if item[0] not in without_effect)).encode())
    return digest.hexdigest()[:16]


def wanted_folder() -> Path:
    """Where kernels of these sources are to be kept."""
    # in a container a user may have no home
    home = Path(os.path.expanduser("~"))
    base = os.environ.get("NUMBA_CACHE_DIR") or Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "parsolid"
    return Path(base) / f"kernels-{source_digest()}"


@cache
def cache_folder() -> Path:
    """Where kernels of these sources are kept: where they are wanted, else in a temporary folder.

    Code in it is run, so it belongs to this user, and nobody else may write to it.
    """
    temporary = Path(tempfile.gettempdir()) / f"parsolid-{os.getuid()}-kernels-{source_digest()}"
    for folder in (wanted_folder(), temporary):
        with suppress(OSError):
            is_new = not folder.exists()
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            about = folder.lstat()
            is_private = about.st_uid == os.getuid() and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
            if stat.S_ISDIR(about.st_mode) and is_private and os.access(folder, os.W_OK):
                os.utime(folder)
                if is_new:
                    _evict_others(folder)
                return folder
    return Path(tempfile.mkdtemp(prefix="parsolid-kernels-"))


def _evict_others(folder: Path) -> None:
    """Remove folders of other sources that have not been used for long."""
    siblings = folder.parent.glob(folder.name.rpartition("-")[0] + "-*")
    by_age = sorted((time.time() - path.stat().st_mtime, path) for path in siblings if path != folder)
    for number, (age, path) in enumerate(by_age):
        if age > 86400 * (1 if number >= _KEPT_FOLDERS else _KEPT_DAYS):
            shutil.rmtree(path, ignore_errors=True)


class PackageLocator:
    """Tells numba where kernels of `PACKAGES` are kept, wherever these are installed, and when they are out of date.

    What numba asks is in numba.core.caching; other functions are left to numba's own locators.
    """

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._py_file, self._module, self._line = file, function.__module__, function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "PackageLocator | None":
        return cls(function, file) if function.__module__.partition(".")[0] in PACKAGES else None

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def ensure_cache_path(self) -> None:
        cache_folder().mkdir(mode=0o700, exist_ok=True)

    def get_source_stamp(self) -> str:
        return source_digest()

    def get_disambiguator(self) -> str:
        return f"{self._module}-{self._line}"


def _readable(load: Callable[..., Any]) -> Callable[..., Any]:
    """Compile where an index cannot be read, as one that is damaged or names the type of a law that is gone."""

    def load_if_readable(self: Any, key: Any) -> Any:
        try:
            return load(self, key)
        except Exception:
            return None

    return load_if_readable


def _one_at_a_time(save: Callable[..., None]) -> Callable[..., None]:
    """Let one process at a time change an index: of two, numba may give both their kernels one file.

    Where the index cannot be read, the kernels that it names are dropped with it, and none of others.
    """

    def save_alone(self: Any, key: Any, data: Any) -> None:
        # a folder that is full only costs time
        with suppress(OSError), (cache_folder() / "lock").open("w") as lock:
            with suppress(OSError):
                fcntl.lockf(lock, fcntl.LOCK_EX)
            try:
                save(self, key, data)
            except OSError:
                raise
            except Exception:
                index = Path(self._index_path)
                for path in (index, *index.parent.glob(f"{glob.escape(index.stem)}.*.nbc")):
                    path.unlink(missing_ok=True)
                save(self, key, data)

    return save_alone


def set_up() -> None:
    """Have numba keep kernels there, whether they are defined already or not."""
    if config.DISABLE_JIT:
        return
    own, usual = f"{__name__}.PackageLocator", "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator"
    if hasattr(config, "CACHE_LOCATOR_CLASSES"):
        config.CACHE_LOCATOR_CLASSES = f"{own},{config.CACHE_LOCATOR_CLASSES or usual + ',IPythonCacheLocator'}"
    else:
        config.CACHE_DIR = str(cache_folder())
    with suppress(ImportError, AttributeError):
        from numba.core.caching import IndexDataCacheFile

        IndexDataCacheFile.load = _readable(IndexDataCacheFile.load)
        IndexDataCacheFile.save = _one_at_a_time(IndexDataCacheFile.save)
    # kernels of `decomposition` that were defined before
    for module in [module for name, module in sys.modules.items() if name.startswith("decomposition.")]:
        for it in vars(module).values():
            if is_jitted(it):
                it.enable_caching()
