"""The processor as LLVM names it, which LLVM is asked once: its answer is in a file beside the kernels, named by what
the processor says of itself and by LLVM's own file.
"""

import ctypes
import functools
import hashlib
import json
import os
import sys
import tempfile
from contextlib import suppress
from importlib.machinery import PathFinder
from pathlib import Path

from decomposition.direct_linking import executable, reserved
from decomposition.kernel_places import folder

# push rbx; mov eax, esi; mov ecx, edx; cpuid; mov [rdi], eax; mov [rdi+4], ebx; mov [rdi+8], ecx; mov [rdi+12], edx;
# pop rbx; ret
_ASK = bytes.fromhex("53 89f0 89d1 0fa2 8907 895f04 894f08 89570c 5b c3")
# what LLVM looks at to tell processors and features apart, and the size of their state that the system has allowed
_LEAVES = ((1, 0), (7, 0), (7, 1), (0xD, 0), (0xD, 1), (0x14, 0), (0x19, 0), (0x1E, 1), (0x24, 0))
_EXTENDED = (0x80000001, 0x80000002, 0x80000003, 0x80000004, 0x80000008)


class _Registers(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_uint32) for name in ("a", "b", "c", "d"))


def cpuid() -> list[tuple[int, int, int, int]]:
    """What an x86-64 processor says of itself, from leaf 0 on. Raises OSError where it cannot be asked."""
    place = reserved(len(_ASK))
    ctypes.memmove(place, _ASK, len(_ASK))
    executable(place, len(_ASK))
    ask = ctypes.CFUNCTYPE(None, ctypes.POINTER(_Registers), ctypes.c_uint32, ctypes.c_uint32)(place)
    found = _Registers()
    told = []
    highest = {0: 0, 1: 0x80000000}
    for leaf, part in ((0, 0), *_LEAVES, (0x80000000, 0), *((it, 0) for it in _EXTENDED)):
        if leaf <= highest[leaf >> 31]:
            ask(found, leaf, part)
            highest[leaf >> 31] = max(highest[leaf >> 31], found.a if leaf in (0, 0x80000000) else 0)
            # which of its cores was asked is in the upper byte
            told.append((found.a, found.b & 0xFFFFFF if leaf == 1 else found.b, found.c, found.d))
    return told


def _asked() -> tuple[str, str, str]:
    import llvmlite.binding as llvm

    features = ""
    # nothing where LLVM does not know
    with suppress(RuntimeError):
        features = str(llvm.get_host_cpu_features().flatten())
    return str(llvm.get_process_triple()), str(llvm.get_host_cpu_name()), features


def _file() -> Path | None:
    """Where the answer is kept; None where it has to be asked for."""
    spec = PathFinder.find_spec("llvmlite")
    if spec is None or not spec.origin or os.uname().machine != "x86_64" or sys.maxsize < 1 << 32:
        return None
    library = Path(spec.origin).with_name("binding") / "libllvmlite.so"
    with suppress(OSError):
        about = library.stat()
        return folder() / f"processor-{_digest((str(library), about.st_size, about.st_mtime_ns, cpuid()))}.json"
    return None


@functools.cache
def described() -> tuple[str, str, str]:
    """Triple, name and features, as numba has them of LLVM."""
    path = None if "llvmlite.binding" in sys.modules else _file()
    if path is None:
        return _asked()
    # kernels are told apart by it, so that one of eight lanes would be called where four are meant if it were damaged
    with suppress(OSError, ValueError, TypeError):
        triple, name, features, digest = json.loads(path.read_bytes())
        if digest == _digest((triple, name, features)):
            return triple, name, features
    found = _asked()
    with suppress(OSError):
        with tempfile.NamedTemporaryFile("w", dir=path.parent, prefix=".new-", delete=False) as file:
            json.dump([*found, _digest(found)], file)
        os.replace(file.name, path)
    return found


def _digest(what: object) -> str:
    return hashlib.sha256(repr(what).encode()).hexdigest()[:32]
