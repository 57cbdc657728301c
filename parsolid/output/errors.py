"""One clear error on all ranks when an output operation fails on any of them."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from mpi4py import MPI

from parsolid.collective import raise_together

# HDF5 has the system's words within its own, MPICH at the end of the calls that led there
_HDF5_REASON = re.compile(r"error message = '([^']+)'")
_MPI_CALL = re.compile(r"^\w+\(\d+\)\.*:\s*(?:Other I/O error\s*)?")


class OutputError(Exception):
    """A file could not be written or read; raised with the same message on every rank."""


def agree(comm: MPI.Comm, error: Exception | None, doing: str) -> None:
    """Raise one OutputError on every rank if any rank brings an error. Collective.

    The message is that of the lowest failing rank: "<doing>: <error> (rank r)".
    """
    fault = None
    if error is not None:
        fault = str(error) if isinstance(error, OutputError) else f"{doing}: {words(error)}"
        fault += f" (rank {comm.rank})" if comm.size > 1 else ""
    raise_together(comm, fault, OutputError)


@contextmanager
def together(comm: MPI.Comm, doing: str) -> Iterator[None]:
    """Run a block on every rank; a failure on any rank becomes one OutputError on all. Collective.

    The block itself must not communicate: a rank that fails inside would leave the others waiting.
    """
    error = None
    try:
        yield
    except Exception as caught:  # whatever it is, the other ranks have to hear of it
        error = caught
    agree(comm, error, doing)


def words(error: Exception) -> str:
    """An error's reason in words, without Python's or the system's numbers, nor the calls of a library that met it."""
    text = str(error) or type(error).__name__
    if within := _HDF5_REASON.search(text):
        return within[1]
    if isinstance(error, OSError) and error.strerror:
        return error.strerror + (f": {error.filename}" if error.filename else "")
    if isinstance(error, MPI.Exception) and "error stack" in text:
        return _MPI_CALL.sub("", text.strip().splitlines()[-1]) or text
    return text
