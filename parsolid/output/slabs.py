"""Contiguous HDF5 data sets that every rank writes its own rows of; no rank gathers.

Rank 0 lays a file out serially: contiguous data sets whose space is allocated early and never filled, so that each has
a fixed place in the file. Then all ranks write the raw numbers of their rows at these places with MPI-IO, whether h5py
is built on parallel HDF5 or not.
"""

import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from mpi4py import MPI

from parsolid.output.errors import OutputError, agree, together, words

# rows are copied and written in pieces of this size: bounds the extra memory, and keeps counts below 2^31
PIECE_BYTES = 32 * 2**20

# a superblock without open-for-writing marks: a killed run leaves a file that opens
LIBRARY_VERSIONS = ("earliest", "v108")
# the same with checksums of all that HDF5 itself keeps in the file
CHECKED_VERSIONS = ("v108", "v108")

# Open MPI's collective writes report success on a full disk (seen with 4.1.4); its independent ones do not,
# and lose nothing: every rank's rows are one contiguous piece
COLLECTIVE = MPI.get_vendor()[0] != "Open MPI"

# what HDF5 itself needs in a file besides the numbers, generously
_METADATA_BYTES = 2**18


class DataSet(NamedTuple):
    """Where a data set lies: byte offset in the file (None when it has no rows), shape, numpy dtype string."""

    offset: int | None
    shape: tuple[int, ...]
    dtype: str


def open_serial(path: Path | str, mode: str, versions: tuple[str, str] = LIBRARY_VERSIONS) -> h5py.File:
    """Open a file on one rank, without HDF5's file lock: a user may look at the file while the run goes on."""
    return h5py.File(path, mode, libver=versions, locking=False)


def create_slab(group: h5py.Group, name: str, shape: tuple[int, ...], dtype: Any) -> None:
    """Create a contiguous data set that has its place in the file at once and whose bytes are left unwritten."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_layout(h5py.h5d.CONTIGUOUS)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    group.create_dataset(name, shape=shape, dtype=dtype, dcpl=properties)


def probe(path: Path | str, size: int) -> None:
    """Make sure that a file of so many bytes can be written; raises OSError. Leaves a file to be overwritten, or none.

    HDF5 itself does not survive a write that fails while a file is laid out, so that is found out before.
    """
    try:
        with open(path, "wb") as file:
            free = shutil.disk_usage(path).free
            if free < size + _METADATA_BYTES:
                raise OSError(f"the disk is full: expected {size + _METADATA_BYTES} bytes free, found {free}")
            file.truncate(size + _METADATA_BYTES)
            file.write(bytes(_METADATA_BYTES))
    except OSError:
        with suppress(OSError):
            os.unlink(path)
        raise


def places(path: Path | str) -> dict[str, DataSet]:
    """Name -> place of every contiguous data set of a file. Raises OutputError where HDF5 cannot tell them."""
    found: dict[str, DataSet] = {}

    def note(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.chunks is None:
            found[name] = DataSet(item.id.get_offset(), item.shape, item.dtype.str)

    try:
        with open_serial(path, "r") as file:
            file.visititems(note)
    except Exception as error:  # what h5py raises depends on where the file is damaged
        raise OutputError(f"{path}: damaged: {words(error)}") from error
    return found


def flush_to_disk(path: Path | str) -> None:
    """Wait until a file's (or directory's) content is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class SlabWriter:
    """Writes rows of laid-out data sets from all ranks; a context manager, entered and left collectively.

    A rank that fails goes on taking part in the collective calls; leaving the context raises one
    OutputError on all ranks, else the data are on the disk.

    Parameters: comm; path of the file laid out; datasets as `places` returns them, the same on all ranks; piece_bytes,
    the most that is copied and written at once.
    """

    def __init__(
        self, comm: MPI.Intracomm, path: Path | str, datasets: dict[str, DataSet], piece_bytes: int = PIECE_BYTES
    ):
        self._comm = comm
        self._path = str(path)
        self._datasets = datasets
        self._piece_bytes = piece_bytes
        self._error: Exception | None = None
        self._file: Any = None

    def __enter__(self) -> "SlabWriter":
        with together(self._comm, f"cannot open {self._path} for writing"):
            open(self._path, "r+b").close()
        self._attempt(self._open)
        agree(self._comm, self._error, f"cannot open {self._path} for writing")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, traceback: object) -> None:
        self._attempt(self._file.Close)
        if kind is None:
            self._attempt(flush_to_disk, self._path)
            agree(self._comm, self._error, f"cannot write {self._path}")

    def write(self, name: str, first_row: int, rows: np.ndarray) -> None:
        """Put rows (n, ...) of any strides at first_row of the data set; converted to its type. Collective.

        n may differ between ranks and may be 0.
        """
        dataset = self._datasets[name]
        if dataset.offset is None:
            return
        row_shape = dataset.shape[1:]
        if rows.shape[1:] != row_shape or first_row + len(rows) > dataset.shape[0]:
            self._error = self._error or OutputError(
                f"{self._path}: {name}: rows {rows.shape} at {first_row} do not fit into {dataset.shape}"
            )
            rows = np.empty((0, *row_shape), dataset.dtype)
        row_bytes = int(np.prod(row_shape, dtype=np.int64)) * np.dtype(dataset.dtype).itemsize
        piece = max(1, self._piece_bytes // row_bytes)
        rounds = -(-self._comm.allreduce(len(rows), op=MPI.MAX) // piece)
        for turn in range(rounds):
            part = np.ascontiguousarray(rows[turn * piece : (turn + 1) * piece], dataset.dtype)
            self._attempt(self._put, dataset.offset + (first_row + turn * piece) * row_bytes, part)

    def _attempt(self, function: Callable[..., None], *arguments: Any) -> None:
        """Call a collective function; keep the first error for the end, so that no rank leaves the others."""
        try:
            function(*arguments)
        except Exception as caught:
            self._error = self._error or caught

    def _open(self) -> None:
        self._file = MPI.File.Open(self._comm, self._path, MPI.MODE_WRONLY)

    def _put(self, offset: int, part: np.ndarray) -> None:
        write = self._file.Write_at_all if COLLECTIVE else self._file.Write_at
        status = MPI.Status()
        write(offset if len(part) else 0, [part, part.nbytes, MPI.BYTE], status)
        if status.Get_elements(MPI.BYTE) != part.nbytes:
            raise OSError(f"the disk is full: only {status.Get_elements(MPI.BYTE)} of {part.nbytes} bytes written")
