"""Messages between ranks: which rows of arrays go to which neighbours, and how they travel.

    Plan               rows that a rank and its neighbours exchange again and again, by persistent requests
    swap               arrays of any length between ranks that know that they are neighbours
    send_to_some       arrays of any length to some ranks, which do not know from whom they will get any

A message holds row after row, each the columns of all arrays. Arrays are packed and unpacked through flat views: column
k of row i of an array stands at `step * i + columns[k]` of its view.

All persistent messages have one tag. MPI does not let messages of two ranks with one tag overtake each other: the k-th
that one starts to send is the k-th that the other starts to receive, whatever is under way at once and in whatever
order they are finished. So two ranks start the exchanges that they have in common in the same order, each once both
have made it; either may free its own and make it anew between two starts, as one whose grid nodes have changed does.
"""

import functools
import math
import os
import weakref
from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI
from numba import njit
from numpy.lib.stride_tricks import as_strided

from .timer import COMMUNICATION

# of all persistent messages; of `swap`; of two rounds of `send_to_some`
_TAG, _SWAP_TAG, _SOME_TAG = 16001, 16002, 16003


# --- packing ------------------------------------------------------------------------------------------------------


# indices are unsigned: numba asks of signed ones whether they are negative, which takes twice the time


@njit(cache=True)
def _pack(flat, step, columns, rows, message, width, first):
    """Copy rows of an array into messages, whose rows are `width` long, from their column `first` on."""
    at, count = np.uintp(first), np.uintp(len(columns))
    for m in range(np.uintp(len(rows))):
        place = np.uintp(step) * np.uintp(rows[m])
        for k in range(count):
            here = place + np.uintp(columns[k])
            message[at + k] = flat[here]
        at += np.uintp(width)


@njit(cache=True)
def _unpack(flat, step, columns, rows, message, width, first):
    """Copy messages into rows of an array."""
    at, count = np.uintp(first), np.uintp(len(columns))
    for m in range(np.uintp(len(rows))):
        place = np.uintp(step) * np.uintp(rows[m])
        for k in range(count):
            here = place + np.uintp(columns[k])
            flat[here] = message[at + k]
        at += np.uintp(width)


@njit(cache=True)
def _add(flat, step, columns, rows, message, width, first):
    """Add messages to rows of an array, one neighbour after the other."""
    at, count = np.uintp(first), np.uintp(len(columns))
    for m in range(np.uintp(len(rows))):
        place = np.uintp(step) * np.uintp(rows[m])
        for k in range(count):
            here = place + np.uintp(columns[k])
            flat[here] += message[at + k]
        at += np.uintp(width)


@njit(cache=True)
def _raise(flat, step, columns, rows, message, width, first):
    """Put the larger of a message and the row into rows of an array."""
    at, count = np.uintp(first), np.uintp(len(columns))
    for m in range(np.uintp(len(rows))):
        place = np.uintp(step) * np.uintp(rows[m])
        for k in range(count):
            here = place + np.uintp(columns[k])
            flat[here] = max(flat[here], message[at + k])
        at += np.uintp(width)


@njit(cache=True)
def _sum(flat, step, columns, rows, message, width, first, lower, own_rows, own):
    """Sum rows that several ranks have, those of lower ranks first, then this rank's, then those of higher ones.

    lower: how many rows of the messages come from lower ranks; own_rows: `rows`, each once; own: room for them.
    """
    count, step, width = np.uintp(len(columns)), np.uintp(step), np.uintp(width)
    for m in range(np.uintp(len(own_rows))):
        place = step * np.uintp(own_rows[m])
        for k in range(count):
            own[count * m + k] = flat[place + np.uintp(columns[k])]
            flat[place + np.uintp(columns[k])] = 0.0
    _add(flat, step, columns, rows[:lower], message, width, first)
    for m in range(np.uintp(len(own_rows))):
        place = step * np.uintp(own_rows[m])
        for k in range(count):
            flat[place + np.uintp(columns[k])] += own[count * m + k]
    _add(flat, step, columns, rows[lower:], message[np.intp(width) * lower :], width, first)


def _flat(array: np.ndarray, kind: type) -> tuple[np.ndarray, int, np.ndarray]:
    """A flat view of an array whose first axis counts rows, the step from row to row in it, and places of columns."""
    columns = np.zeros(1, np.int64)
    for length, stride in zip(array.shape[1:], array.strides[1:]):
        columns = (columns[:, None] + stride // 8 * np.arange(length)).ravel()
    last = (len(array) - 1) * array.strides[0] // 8 + columns.max(initial=0)
    return as_strided(array.view(kind), (last + 1,), (8,)), array.strides[0] // 8, columns


def _checked(array: np.ndarray, index: int, capacity: int, numbers: bool) -> None:
    name = f"arrays[{index}]"
    if not isinstance(array, np.ndarray) or array.ndim == 0 or not array.flags.writeable:
        raise ValueError(f"{name}: expected a writeable array of shape (capacity, ...), found {type(array).__name__}")
    if len(array) < capacity:
        raise ValueError(f"{name}: expected at least {capacity} rows (own ones and others'), found {len(array)}")
    if array.dtype.hasobject or array.dtype.itemsize != 8 or not array.dtype.isnative:
        raise ValueError(f"{name}: expected a type of 8 bytes, found {array.dtype}")
    if numbers and array.dtype != np.float64:
        raise ValueError(f"{name}: expected float64 to add up or compare, found {array.dtype}")


# --- the same rows again and again --------------------------------------------------------------------------------


class Messages:
    """Persistent requests for one message to and one from each neighbour.

    outgoing, incoming: buffers of float64, the messages one after the other, as long as `sent` and `received` say.
    """

    def __init__(self, comm: MPI.Comm, neighbours: Sequence[int], sent: Sequence[int], received: Sequence[int]) -> None:
        self.outgoing, self.incoming = np.empty(sum(sent)), np.empty(sum(received))
        self._receives = _requests(comm.Recv_init, neighbours, received, self.incoming)
        self._sends = _requests(comm.Send_init, neighbours, sent, self.outgoing)
        self._all = self._receives + self._sends
        self._finalizer = weakref.finalize(self, _release, self._all.copy())
        self.silent = not self._all

    def receive(self) -> None:
        """Be ready for the neighbours' messages; before `send`."""
        MPI.Prequest.Startall(self._receives)

    def send(self) -> None:
        """Send what is in the buffer."""
        MPI.Prequest.Startall(self._sends)

    def wait(self) -> None:
        """Until all have been sent and received."""
        MPI.Prequest.Waitall(self._all)

    def free(self) -> None:
        """Give the requests back to MPI now; garbage collection does so otherwise."""
        self._finalizer()
        self._all = self._receives = self._sends = []
        self.silent = True


def _requests(make: Any, neighbours: Sequence[int], counts: Sequence[int], buffer: np.ndarray) -> list[Any]:
    requests, at = [], 0
    for rank, count in zip(neighbours, counts):
        if count:
            requests.append(make([buffer[at : at + count], MPI.DOUBLE], rank, _TAG))
        at += count
    return requests


def _release(requests: list[MPI.Prequest]) -> None:
    if not MPI.Is_finalized():
        for request in requests:
            request.Free()
    requests.clear()


class Exchange:
    """A set of arrays whose rows travel again and again; made by a `Plan`.

    Holds views of the arrays, which must not be resized. What is sent is copied at the start; what is received is
    written at the finish, so between the two the arrays are free, save for sums and maxima, of which the finish reads
    the own rows. Several may be under way at once if all ranks start them in the same order.

    bytes_sent: by one start on this rank; silent: whether start and finish do nothing on this rank.
    """

    def __init__(self, plan: "Plan", arrays: Sequence[np.ndarray], unpack: Any, backward: bool = False) -> None:
        """unpack: one of the functions of this module; backward: what the plan receives is sent."""
        sent, received = (plan.receive_rows, plan.send_rows) if backward else (plan.send_rows, plan.receive_rows)
        kind = np.int64 if unpack is _unpack else np.float64
        for index, array in enumerate(arrays):
            _checked(array, index, plan.capacity, kind is np.float64)
        width = sum(math.prod(array.shape[1:]) for array in arrays)
        outgoing, incoming = ([width * len(rows) for rows in side] for side in (sent, received))
        self.messages = Messages(plan.comm, plan.neighbours, outgoing, incoming)
        self.bytes_sent, self.silent, self._freed = self.messages.outgoing.nbytes, self.messages.silent, False
        self._packed = _copies(arrays, sent, self.messages.outgoing, width, np.int64)
        self._unpacked = _copies(arrays, received, self.messages.incoming, width, kind)
        if unpack is _sum:
            lower = sum(len(rows) for rank, rows in zip(plan.neighbours, received) if rank < plan.comm.rank)
            own_rows = np.unique(_joined(received))
            self._unpacked = [(*one, lower, own_rows, np.empty(len(own_rows) * len(one[2]))) for one in self._unpacked]
        self._unpack = unpack

    def start(self) -> None:
        """Pack and send; returns while the messages travel."""
        if self._freed:
            raise RuntimeError("Exchange: expected one that is in use, found it freed")
        if self.silent:
            return
        with COMMUNICATION:
            self.messages.receive()
            for arguments in self._packed:
                _pack(*arguments)
            self.messages.send()

    def finish(self) -> None:
        """Wait for the messages and unpack them."""
        if self.silent:
            return
        with COMMUNICATION:
            self.messages.wait()
            for arguments in self._unpacked:
                self._unpack(*arguments)

    def now(self) -> None:
        """Start and finish."""
        self.start()
        self.finish()

    def free(self) -> None:
        """Give the requests back to MPI now; garbage collection does so otherwise. No start may follow."""
        self.messages.free()
        self._freed = self.silent = True


def _copies(
    arrays: Sequence[np.ndarray], rows: list[np.ndarray], buffer: np.ndarray, width: int, kind: type
) -> list[tuple[Any, ...]]:
    """Arguments of the functions that pack and unpack, an array each."""
    copies: list[tuple[Any, ...]] = []
    first, joined = 0, _joined(rows)
    for array in arrays if len(joined) else ():
        flat, step, columns = _flat(array, kind)
        copies.append((flat, step, columns, joined, buffer.view(kind), width, first))
        first += len(columns)
    return copies


def _joined(rows: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.zeros(0, np.int64), *rows])


class Plan:
    """Which rows of a rank go to which neighbours, and into which of its rows theirs come.

    neighbours: ranks, rising; send_rows, receive_rows: rows (int64) of each neighbour, in an order that both know.
    Exchanges are started and finished in the same order on all ranks. Their arrays (capacity, ...) have any
    strides and any type of 8 bytes, the same columns on all ranks; all travel in one message a neighbour.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        ranks: Sequence[int],
        send_rows: Sequence[np.ndarray],
        receive_rows: Sequence[np.ndarray],
        capacity: int = 0,
    ) -> None:
        """Ranks with which no rows are exchanged are left out; capacity: rows that arrays have at least."""
        used = [k for k in range(len(ranks)) if len(send_rows[k]) or len(receive_rows[k])]
        self.comm, self.neighbours = comm, [int(ranks[k]) for k in used]
        self.send_rows = [np.asarray(send_rows[k], np.int64) for k in used]
        self.receive_rows = [np.asarray(receive_rows[k], np.int64) for k in used]
        last = [int(rows.max()) for rows in self.send_rows + self.receive_rows if len(rows)]
        self.capacity = max([capacity - 1, *last]) + 1

    def forward(self, *arrays: np.ndarray) -> Exchange:
        """An exchange that copies the rows that are sent into those that receive."""
        return Exchange(self, arrays, _unpack)

    def reverse(self, *arrays: np.ndarray) -> Exchange:
        """An exchange that adds the rows that receive, which keep their values, to those that are sent, in the order
        of the ranks that hold them; float64."""
        return Exchange(self, arrays, _add, backward=True)

    def sum(self, *arrays: np.ndarray) -> Exchange:
        """An exchange that sums rows over the ranks that have them, in the order of ranks, so that all get the same
        bits; float64. The rows that are sent are those that receive."""
        return Exchange(self, arrays, _sum)

    def largest(self, *arrays: np.ndarray) -> Exchange:
        """An exchange that finds the largest of each number over the ranks that have the row; otherwise as `sum`."""
        return Exchange(self, arrays, _raise)


# --- arrays of any length -----------------------------------------------------------------------------------------


def _row_type(array: np.ndarray) -> MPI.Datatype:
    """A row of an array; messages are counted in rows, because bytes may not fit the 32-bit counts of MPI."""
    return MPI.BYTE.Create_contiguous(array.dtype.itemsize * math.prod(array.shape[1:])).Commit()


def swap(comm: MPI.Comm, ranks: Sequence[int], outgoing: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Send each rank its array and return theirs, in the order of the ranks, which all do the same.

    outgoing: an array (n, ...) a rank, n different for each, rows of one shape and plain type on both sides.
    """
    if not ranks:
        return []
    kind, shape = outgoing[0].dtype, outgoing[0].shape[1:]
    row, incoming, status = _row_type(outgoing[0]), [], MPI.Status()
    try:
        with COMMUNICATION:
            packed = [np.ascontiguousarray(array) for array in outgoing]
            requests = [comm.Isend([array, len(array), row], rank, _SWAP_TAG) for array, rank in zip(packed, ranks)]
            for rank in ranks:
                comm.Probe(rank, _SWAP_TAG, status)
                incoming.append(np.empty((status.Get_count(row), *shape), kind))
                comm.Recv([incoming[-1], len(incoming[-1]), row], rank, _SWAP_TAG)
            MPI.Request.Waitall(requests)
    finally:
        row.Free()
    return incoming


@functools.cache
def _rounds_key() -> int:
    """The attribute of a communicator that says how often `send_to_some` was called on it.

    Made at its first use: programs that draw pictures import this without MPI.
    """
    return MPI.Comm.Create_keyval()


def send_to_some(
    comm: MPI.Comm, ranks: Sequence[int], outgoing: Sequence[np.ndarray], like: np.ndarray
) -> tuple[list[int], list[np.ndarray]]:
    """Send each of some ranks an array; collective. Returns the ranks, rising, that have sent this one any, and theirs.

    outgoing: an array (n, ...) a rank, whose rows have the type and shape of those of `like` on all ranks; ranks differ
    and are not this one. Nothing grows with the number of ranks but the time of a barrier. Source: T. Hoefler,
    C. Siebert, A. Lumsdaine, "Scalable communication protocols for dynamic sparse data exchange", PPoPP 2010:
    synchronous sends tell a rank that all of its messages have arrived, a non-blocking barrier that those of all have.
    """
    # a rank may be in the next round when another still looks for messages of this one
    rounds = comm.Get_attr(_rounds_key()) or 0
    comm.Set_attr(_rounds_key(), rounds + 1)
    tag, row, status = _SOME_TAG + rounds % 2, _row_type(like), MPI.Status()
    found: dict[int, np.ndarray] = {}
    try:
        with COMMUNICATION:
            packed = [np.ascontiguousarray(array) for array in outgoing]
            sends = [comm.Issend([array, len(array), row], rank, tag) for array, rank in zip(packed, ranks)]
            barrier: MPI.Request | None = None
            while barrier is None or not barrier.Test():
                if comm.Iprobe(MPI.ANY_SOURCE, tag, status):
                    array = np.empty((status.Get_count(row), *like.shape[1:]), like.dtype)
                    source = status.Get_source()
                    comm.Recv([array, len(array), row], source, tag)
                    found[source] = array
                elif barrier is None and MPI.Request.Testall(sends):
                    barrier = comm.Ibarrier()
                else:
                    # there may be more ranks than processors
                    os.sched_yield()
    finally:
        row.Free()
    sources = sorted(found)
    return sources, [found[rank] for rank in sources]
