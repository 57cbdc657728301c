"""Messages between owners and ghosts: one a neighbour for any set of arrays, packed and unpacked by a numba call each.

A transfer is described by one table of integers, made once: addresses, strides and lengths of the runs of columns that
stand beside one another in memory, the rows that go to or come from each neighbour, and the message buffer, in which
rows follow one another. A start is then one numba call with one argument.
"""

import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.compiled import compiled
from decomposition.deferred import Elsewhere

# MPI promises tags up to 32767
_TAGS = 1 << 14
_HEADER = 5


def _addresses() -> Any:
    """Imported with numba; kernels are compiled from its text."""
    from decomposition import addresses

    return addresses


_there = Elsewhere("decomposition.addresses")
_load, _store, _add, _copy_four = _there.load, _there.store, _there.add, _there.copy_four


@compiled
def _copy(table: np.ndarray, received: bool | None, added: bool | None) -> None:
    """Copy rows into the messages, row by row; messages into rows where `received` is not None.

    added: not None to add them to the rows, one neighbour after the other.
    """
    runs, messages, width, row, message = table[0], table[1], table[2], table[3], table[4]
    for m in range(messages):
        for _ in range(table[_HEADER + 3 * runs + m]):
            number, at = _load(row), message
            for run in range(_HEADER, _HEADER + 3 * runs, 3):
                place, last = table[run] + table[run + 1] * number, at + 8 * table[run + 2]
                if added is None:
                    while at + 32 <= last:
                        if received is None:
                            _copy_four(at, place)
                        else:
                            _copy_four(place, at)
                        at, place = at + 32, place + 32
                while at < last:
                    if received is None:
                        _store(at, _load(place))
                    elif added is None:
                        _store(place, _load(at))
                    else:
                        _add(place, at)
                    at, place = at + 8, place + 8
            row, message = row + 8, message + 8 * width


def _runs(array: np.ndarray) -> list[int]:
    """Address, row stride and length of each run of columns beside one another, of an array whose first axis counts
    rows."""
    offsets = np.zeros(1, np.int64)
    for length, step in zip(array.shape[1:], array.strides[1:]):
        offsets = (offsets[:, None] + step * np.arange(length)).ravel()
    first = np.flatnonzero(np.diff(offsets, prepend=-16) != 8)
    lengths = np.diff(first, append=len(offsets))
    found = zip((array.ctypes.data + offsets[first]).tolist(), lengths.tolist())
    return [number for base, length in found for number in (base, array.strides[0], length)]


def _table(arrays: list[np.ndarray], rows: np.ndarray, counts: Sequence[int], buffer: np.ndarray) -> np.ndarray:
    runs = [number for array in arrays for number in _runs(array)]
    width = sum(runs[2::3])
    header = [len(runs) // 3, len(counts), width, rows.ctypes.data, buffer.ctypes.data]
    return np.array(header + runs + list(counts), np.int64)


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

    Made by `Halo.exchange` and `Halo.accumulate`. Holds addresses in the arrays, which it keeps alive and which must
    not be resized. What is sent is copied at the start; what is received is written at the finish, so between the two
    the arrays are free. Several may be under way at once if all ranks start them in the same order.

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
        self._rows = outgoing[2], incoming[2]
        self._buffers = np.empty(width * len(outgoing[2])), np.empty(width * len(incoming[2]))
        self.bytes_sent, self.bytes_received = (buffer.nbytes for buffer in self._buffers)
        self._pack_table = _table(self._arrays, outgoing[2], outgoing[1], self._buffers[0])
        self._unpack_table = _table(self._arrays, incoming[2], incoming[1], self._buffers[1])
        self._added = True if accumulate else None
        self._receives = self._requests(comm.Recv_init, incoming, self._buffers[1], width, tag)
        self._sends = self._requests(comm.Send_init, outgoing, self._buffers[0], width, tag)
        self._all = self._receives + self._sends
        self._finalizer = weakref.finalize(self, _release, self._all.copy())
        self.silent = not self._all
        if self.silent:
            self._turn_into(_nothing)

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

    def _turn_into(self, action: Callable[[], None]) -> None:
        """Let start and finish do something else from now on; both are called in every step, so they ask nothing."""
        vars(self).update(start=action, finish=action)

    def start(self) -> None:
        """Pack and send; returns while the messages travel."""
        MPI.Prequest.Startall(self._receives)
        _copy(self._pack_table, None, None)
        MPI.Prequest.Startall(self._sends)

    def finish(self) -> None:
        """Wait for the messages and unpack them."""
        MPI.Prequest.Waitall(self._all)
        _copy(self._unpack_table, True, self._added)

    def progress(self) -> bool:
        """Let MPI move large messages along during long work between start and finish; True when all have arrived."""
        return MPI.Prequest.Testall(self._all)

    def free(self) -> None:
        """Give the requests back to MPI now; garbage collection does so otherwise. No start may follow."""
        self._finalizer()
        self._all = self._receives = self._sends = []
        self._turn_into(_freed)


def _nothing() -> None:
    """No neighbours, nothing to do."""


def _freed() -> None:
    raise RuntimeError("Exchange: expected one that is in use, found it freed")
