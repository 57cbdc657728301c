"""Checksums: of arrays that ranks share, the same on any number of them, and of texts.

Every word of an array is mixed with its place, and the results are added modulo 2^64: ranks add what theirs give. The
mix is one-to-one, so that no single changed word goes unseen, and several do with a chance of 2^-64.
"""

import hashlib

import numpy as np
from mpi4py import MPI

# constants of splitmix64 (Steele, Lea and Flood, OOPSLA 2014)
_PLACE, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
# words that are worked on at once stay in the cache
_BLOCK = 2**15
# before the checksum of a text, at its end
_COMMENT = "# checksum "
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
        total += int(mixed(block + (_STEPS[: len(block)] + offset)).sum(dtype=np.uint64))
    return total % 2**64


def mixed(words: np.ndarray) -> np.ndarray:
    """Words (uint64), which are changed in place, each mixed by itself; one-to-one."""
    words ^= words >> np.uint64(30)
    words *= _FIRST
    words ^= words >> np.uint64(27)
    words *= _SECOND
    words ^= words >> np.uint64(31)
    return words


def digest(data: bytes) -> str:
    """The checksum of a text, 32 hexadecimal digits."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def with_checksum(text: str) -> str:
    """Lines, and a comment with their checksum."""
    return f"{text}{_COMMENT}{digest(text.encode())}\n"


def matches_checksum(text: str) -> bool:
    """Whether lines are what `with_checksum` was given; true of lines without its comment."""
    lines, comment, stated = text.rpartition(_COMMENT)
    return not comment or stated == f"{digest(lines.encode())}\n"


def added(comm: MPI.Intracomm, sums: dict[str, int]) -> dict[str, int]:
    """Parts of all ranks, whose names are the same, added modulo 2^64; collective."""
    total = np.array([sums[name] for name in sorted(sums)], np.uint64)
    comm.Allreduce(MPI.IN_PLACE, total)
    return dict(zip(sorted(sums), total.tolist()))
