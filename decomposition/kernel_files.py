"""What a file of a compiled kernel holds: first what a call from Python needs, the machine code and the name of its
entry point; behind it what the compilation of a caller needs, types and code to link in, read only then.

A call needs no types from the file: they are those of the call, by which the file was found.
"""

import hashlib
import os
import pickle
import struct
from pathlib import Path
from typing import Any, NamedTuple

# digest and length of the first part, digest and length of the second
_HEAD = struct.Struct("<32sQ32sQ")
# what errors of a file that cannot be read are, also by a numba that is built otherwise; such a file is as good as none
UNREADABLE = (OSError, EOFError, pickle.UnpicklingError, ValueError, struct.error, AttributeError, TypeError)


class Called(NamedTuple):
    """What a call needs, in plain Python.

    function: names of its module, of it and of its entry point; environments: names, modules and constants, its own
    first; symbols: what the machine code takes from elsewhere, None where that is not known; alone: whether it can be
    called without numba; on_loading, counts: see `loaded_kernels`.
    """

    machine_code: bytes
    function: tuple[str, str, str]
    environments: list[tuple[str, str | None, bytes]]
    symbols: list[str] | None
    alone: bool
    on_loading: bytes
    counts: str


def written(called: Called, linked: bytes) -> bytes:
    """The content of a file."""
    first = pickle.dumps(tuple(called), protocol=4)
    return b"".join((_HEAD.pack(*_told(first), *_told(linked)), first, linked))


def _told(part: bytes) -> tuple[bytes, int]:
    return hashlib.sha256(part).digest(), len(part)


def _part(path: Path, second: bool) -> Any:
    with path.open("rb") as file:
        digest, length, digest_behind, length_behind = _HEAD.unpack(file.read(_HEAD.size))
        if os.fstat(file.fileno()).st_size != _HEAD.size + length + length_behind:
            raise EOFError(path)
        if second:
            file.seek(length, os.SEEK_CUR)
        part = file.read(length_behind if second else length)
    if hashlib.sha256(part).digest() != (digest_behind if second else digest):
        raise ValueError(path)
    return pickle.loads(part)


def called_part(path: Path) -> Called:
    """The first part of a file. Raises one of `UNREADABLE`."""
    return Called(*_part(path, second=False))


def linked_part(path: Path) -> Any:
    """The second part of a file. Raises one of `UNREADABLE`."""
    return _part(path, second=True)


def constants_of(pickled: bytes) -> list[Any]:
    """The constants of an environment."""
    return list(pickle.loads(pickled)) if pickled else []


def symbols_of(machine_code: bytes) -> list[str] | None:
    """What machine code takes from elsewhere, by the table of symbols of an ELF file of 64 bits; None of another."""
    if machine_code[:6] != b"\x7fELF\x02\x01":
        return None
    (at,) = struct.unpack_from("<Q", machine_code, 40)
    size, count = struct.unpack_from("<HH", machine_code, 58)
    # name, type, flags, address, offset, size, link, ...
    sections = [struct.unpack_from("<IIQQQQIIQQ", machine_code, at + size * k) for k in range(count)]
    names: set[str] = set()
    for section in sections:
        if section[1] != _SYMBOLS:
            continue
        texts = sections[section[6]][4]
        for place in range(section[4], section[4] + section[5], 24):
            name, _, _, defined_in = struct.unpack_from("<IBBH", machine_code, place)
            if name and not defined_in:
                start = texts + name
                names.add(machine_code[start : machine_code.index(b"\0", start)].decode())
    return sorted(names)


# the type of such a section
_SYMBOLS = 2
