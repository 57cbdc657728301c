"""summary.json: settings and results of a run, and the versions and machine that it ran with."""

import functools
import json
import math
import os
import platform
import resource
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numba
import numpy as np
from mpi4py import MPI

import parsolid
from parsolid.checksums import digest
from parsolid.output.errors import OutputError, words

_CHECKSUM = "checksum"


def write_summary(path: Path | str, summary: dict[str, Any]) -> None:
    """Write a summary as JSON, keys in the order given, beside and renamed; for one rank alone.

    The last entry is the checksum of the others. numpy values become numbers and lists; numbers that are not finite
    become null.
    Raises OutputError.
    """
    path, plain = Path(path), {key: value for key, value in _plain(summary).items() if key != _CHECKSUM}
    text = _as_json(plain | {_CHECKSUM: digest(_as_json(plain).encode())}) + "\n"
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_text(text, encoding="utf-8")
        os.replace(partial, path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {words(error)}") from error


def read_summary(path: Path) -> dict[str, Any]:
    """The entries of summary.json. Raises OutputError where it is missing or damaged."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        stated = found.pop(_CHECKSUM, None)
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise OutputError(f"cannot read {path}: {words(error)}") from error
    if stated not in (None, digest(_as_json(found).encode())):
        raise OutputError(f"{path}: damaged: it is not as it was written (checksums differ)")
    return dict(found)


def _as_json(plain: dict[str, Any]) -> str:
    return json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False)


def peak_memory_bytes(present: bool = False) -> int:
    """Peak resident memory of this process [bytes]; present: the resident memory now, where that is known."""
    try:
        # getrusage would count the memory of the process before exec
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmRSS:" if present else "VmHWM:"):
                return 1024 * int(line.split()[1])
    except OSError:
        pass  # not Linux
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else 1024 * peak


@functools.cache
def git_hash() -> str | None:
    """Commit of the checkout this package runs from, "-modified" when files differ from it; None outside of one.

    As of the first call in this process.
    """
    package = Path(parsolid.__file__).resolve().parent
    # a package installed into an environment inside somebody's repository is not part of that repository
    if _git(package, "ls-files", "--error-unmatch", "__init__.py") is None:
        return None
    commit = _git(package, "rev-parse", "HEAD")
    sources = (str(package), str(package.parent / "decomposition"))
    changes = _git(package, "status", "--porcelain", "--untracked-files=no", "--", *sources)
    return commit and commit + ("-modified" if changes else "")


def versions() -> dict[str, str]:
    """Versions of the software that results may depend on."""
    return {
        "parsolid": parsolid.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "h5py": h5py.__version__,
        "hdf5": h5py.version.hdf5_version,
        "mpi": " ".join(MPI.Get_library_version().split()[:3]).strip(", \0"),
    }


def provenance() -> dict[str, Any]:
    """Entries of summary.json on the program: commit, versions, host and time."""
    return {
        "git_hash": git_hash(),
        "versions": versions(),
        "host": platform.node(),
        "written_at": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def _git(directory: Path, *arguments: str) -> str | None:
    try:
        command = ["git", "-C", str(directory), *arguments]
        result = subprocess.run(command, check=False, capture_output=True, text=True, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return result.stdout.strip() if result.returncode == 0 else None


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
