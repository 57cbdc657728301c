"""Checksums of what is written: of arrays that the ranks share, the same on any number of them, and of texts.

Every word of an array is mixed with its place, and the results are added modulo 2^64: ranks add what theirs give. The
mix is one-to-one, so that no single changed word goes unseen, and several do with a chance of 2^-64.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI

from parsolid.output.errors import OutputError, words

# constants of splitmix64 (Steele, Lea and Flood, OOPSLA 2014)
_PLACE, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
# words that are worked on at once stay in the cache
_BLOCK = 2**15
_STEPS = np.arange(1, _BLOCK + 1, dtype=np.uint64) * _PLACE


def sum_of_rows(rows: np.ndarray, first_row: int) -> int:
    """What rows (n, ...) from first_row on give to an array's checksum; parts of an array add up modulo 2^64."""
    rows = np.ascontiguousarray(rows)
    row_bytes = rows.dtype.itemsize * int(np.prod(rows.shape[1:], dtype=np.int64))
    size = next(size for size in (8, 4, 2, 1) if row_bytes % size == 0)
    words = rows.reshape(-1).view(f"u{size}") if rows.size else np.empty(0, np.uint8)
    place, total = first_row * (row_bytes // size), 0
    for start in range(0, len(words), _BLOCK):
        block = words[start : start + _BLOCK]
        offset = np.uint64((place + start) * int(_PLACE) % 2**64)
        total += int(_mixed(block + (_STEPS[: len(block)] + offset)).sum(dtype=np.uint64))
    return total % 2**64


def _mixed(words: np.ndarray) -> np.ndarray:
    words ^= words >> np.uint64(30)
    words *= _FIRST
    words ^= words >> np.uint64(27)
    words *= _SECOND
    words ^= words >> np.uint64(31)
    return words


def digest(data: bytes) -> str:
    """The checksum of a text, 32 hexadecimal digits."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def added(comm: MPI.Intracomm, sums: dict[str, int]) -> dict[str, int]:
    """Parts of all ranks, whose names are the same, added modulo 2^64; collective."""
    total = np.array([sums[name] for name in sorted(sums)], np.uint64)
    comm.Allreduce(MPI.IN_PLACE, total)
    return dict(zip(sorted(sums), total.tolist()))


def stated_sums(file: h5py.File) -> dict[str, Any]:
    """What a file says of its data sets. Raises OutputError when that itself is damaged."""
    try:
        own, _, text = file["checksums"][()].partition(b"\n")
        if digest(text).encode() == own:
            stated: dict[str, Any] = json.loads(text)
            return stated
    except Exception as error:  # what h5py raises depends on where the file is torn
        raise damaged(file, "checksums", words(error)) from error
    raise damaged(file, "checksums")


def sound_header(file: h5py.File, stated: dict[str, Any]) -> dict[str, Any]:
    """The header that was written. Raises OutputError when it is another."""
    try:
        text = file["header"][()]
        if digest(text) == stated["header"]:
            header: dict[str, Any] = json.loads(text)
            return header
    except Exception as error:  # what h5py raises depends on where the file is torn
        raise damaged(file, "header", words(error)) from error
    raise damaged(file, "header")


def check_shapes(file: h5py.File, stated: dict[str, Any]) -> None:
    """Raise OutputError unless a file has the data sets, shapes and types that it had when it was written."""
    found: dict[str, Any] = {}

    def note(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = [list(item.shape), item.dtype.str]

    file.visititems(note)
    wanted = {name: entry[:2] for name, entry in stated.items() if name != "header"}
    for name in sorted({*wanted, *found} - {"header", "checksums"}):
        if wanted.get(name) != found.get(name):
            told = f"expected {_kind(wanted.get(name))}, found {_kind(found.get(name))}"
            raise damaged(file, name, told)


def _kind(entry: list[Any] | None) -> str:
    return "none" if entry is None else f"{entry[1]} {tuple(entry[0])}"


def compare(stated: dict[str, Any], found: dict[str, int], path: Path | str) -> None:
    """Raise OutputError unless the checksums of what was read are those that a file states."""
    wrong = [name for name in sorted(found) if stated[name][2] != found[name]]
    if wrong:
        raise OutputError(f"{Path(path).name}: damaged: {', '.join(wrong)} not as written (checksums differ)")


def damaged(file: h5py.File, name: str, told: str = "not as written (checksums differ)") -> OutputError:
    """The error of a data set that is not as it was written."""
    return OutputError(f"{Path(file.filename).name}: damaged: {name}: {told}")
