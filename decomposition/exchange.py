"""Messages between owners and ghosts: one a neighbour for any set of arrays.

A message holds row after row, each the columns of all arrays. Arrays are packed and unpacked through flat views: column
k of row i of an array stands at `step * i + columns[k]` of its view.
"""

import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from numba import njit
from numpy.lib.stride_tricks import as_strided

# MPI promises tags up to 32767
_TAGS = 1 << 14


@njit(cache=True)
def _pack(flat, step, columns, rows, message, width, first):
    """Copy rows of an array into messages, whose rows are `width` long, from their column `first` on."""
    for m in range(len(rows)):
        place, at = step * rows[m], width * m + first
        for k in range(len(columns)):
            message[at + k] = flat[place + columns[k]]


@njit(cache=True)
def _unpack(flat, step, columns, rows, message, width, first):
    """Copy messages into rows of an array."""
    for m in range(len(rows)):
        place, at = step * rows[m], width * m + first
        for k in range(len(columns)):
            flat[place + columns[k]] = message[at + k]


@njit(cache=True)
def _add(flat, step, columns, rows, message, width, first):
    """Add messages to rows of an array, one neighbour after the other."""
    for m in range(len(rows)):
        place, at = step * rows[m], width * m + first
        for k in range(len(columns)):
            flat[place + columns[k]] += message[at + k]


def _flat(array: np.ndarray, kind: type) -> tuple[np.ndarray, int, np.ndarray]:
    """A flat view of an array whose first axis counts rows, the step from row to row in it, and places of columns."""
    columns = np.zeros(1, np.int64)
    for length, stride in zip(array.shape[1:], array.strides[1:]):
        columns = (columns[:, None] + stride // 8 * np.arange(length)).ravel()
    last = (len(array) - 1) * array.strides[0] // 8 + columns.max(initial=0)
    return as_strided(array.view(kind), (last + 1,), (8,)), array.strides[0] // 8, columns


def _release(requests: list[MPI.Prequest]) -> None:
    """Give the persistent requests back to MPI."""
    if not MPI.Is_finalized():
        for request in requests:
            request.Free()
    requests.clear()


def _checked(array: np.ndarray, index: int, capacity: int, accumulate: bool) -> None:
    name = f"arrays[{index}]"
    if not isinstance(array, np.ndarray) or array.ndim == 0 or not array.flags.writeable:
        raise ValueError(f"{name}: expected a writeable array of shape (capacity, ...), found {type(array).__name__}")
    if len(array) < capacity:
        raise ValueError(f"{name}: expected at least {capacity} rows (owned and ghosts), found {len(array)}")
    if array.dtype.hasobject or array.dtype.itemsize != 8 or not array.dtype.isnative:
        raise ValueError(f"{name}: expected a type of 8 bytes, found {array.dtype}")
    if accumulate and array.dtype != np.float64:
        raise ValueError(f"{name}: expected float64 to add up, found {array.dtype}")


# ranks, counts and rows of messages, rows int64 in the order of the messages
Side = tuple[Sequence[int], Sequence[int], np.ndarray]


class Exchange:
    """A set of arrays to be sent from owners to ghosts, or added from ghosts to owners, again and again.

    Made by `Halo.exchange` and `Halo.accumulate`. Holds views of the arrays, which must not be resized. What is sent is
    copied at the start; what is received is written at the finish, so between the two the arrays are free. Several may
    be under way at once if all ranks start them in the same order.

    bytes_sent, bytes_received: of one start on this rank; silent: whether start and finish do nothing on it.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        arrays: Sequence[np.ndarray],
        outgoing: Side,
        incoming: Side,
        capacity: int,
        tag: int,
        accumulate: bool,
    ) -> None:
        """outgoing, incoming: (ranks, counts, rows), rows int64 in the order of the messages."""
        self._arrays = list(arrays)
        for index, array in enumerate(self._arrays):
            _checked(array, index, capacity, accumulate)
        width = sum(int(np.prod(array.shape[1:])) for array in self._arrays)
        self._buffers = np.empty(width * len(outgoing[2])), np.empty(width * len(incoming[2]))
        self.bytes_sent, self.bytes_received = (buffer.nbytes for buffer in self._buffers)
        self._packed = self._copies(outgoing[2], self._buffers[0], width, np.int64)
        self._unpacked = self._copies(incoming[2], self._buffers[1], width, np.float64 if accumulate else np.int64)
        self._unpack = _add if accumulate else _unpack
        self._receives = self._requests(comm.Recv_init, incoming, self._buffers[1], width, tag)
        self._sends = self._requests(comm.Send_init, outgoing, self._buffers[0], width, tag)
        self._all = self._receives + self._sends
        self._finalizer = weakref.finalize(self, _release, self._all.copy())
        self.silent, self._freed = not self._all, False

    def _copies(self, rows: np.ndarray, buffer: np.ndarray, width: int, kind: type) -> list[tuple[Any, ...]]:
        """Arguments of `_pack` or `_unpack`, an array each."""
        copies: list[tuple[Any, ...]] = []
        first = 0
        for array in self._arrays if len(rows) else ():
            flat, step, columns = _flat(array, kind)
            copies.append((flat, step, columns, rows, buffer.view(kind), width, first))
            first += len(columns)
        return copies

    @staticmethod
    def _requests(
        make: Callable[..., MPI.Prequest], side: Side, buffer: np.ndarray, width: int, tag: int
    ) -> list[MPI.Prequest]:
        requests, at = [], 0
        for rank, count in zip(side[0], side[1]):
            if width * count:
                requests.append(make([buffer[at : at + width * count], MPI.DOUBLE], rank, tag))
            at += width * count
        return requests

    def start(self) -> None:
        """Pack and send; returns while the messages travel."""
        if self._freed:
            raise RuntimeError("Exchange: expected one that is in use, found it freed")
        if self.silent:
            return
        MPI.Prequest.Startall(self._receives)
        for arguments in self._packed:
            _pack(*arguments)
        MPI.Prequest.Startall(self._sends)

    def finish(self) -> None:
        """Wait for the messages and unpack them."""
        if self.silent:
            return
        MPI.Prequest.Waitall(self._all)
        for arguments in self._unpacked:
            self._unpack(*arguments)

    def progress(self) -> bool:
        """Let MPI move large messages along during long work between start and finish; True when all have arrived."""
        return MPI.Prequest.Testall(self._all)

    def free(self) -> None:
        """Give the requests back to MPI now; garbage collection does so otherwise. No start may follow."""
        self._finalizer()
        self._all = self._receives = self._sends = []
        self._freed = self.silent = True
