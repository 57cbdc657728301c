"""Sums over ranks of what they give to shared nodes: one message a neighbour, with persistent requests."""

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numba import njit

from .exchange import _release


@dataclass
class Sharing:
    """What a rank shares with each of its neighbours, in their order.

    shared: slots of common nodes, in the order of the nodes' words, the same on both sides.
    """

    neighbours: list[int]
    shared: list[np.ndarray]
    version: int = 0

    @property
    def shared_nodes(self) -> int:
        """How many nodes of this rank others have as well."""
        return len(np.unique(np.concatenate([np.zeros(0, np.int32), *self.shared])))


@njit(cache=True)
def _pack(nodes: np.ndarray, first: int, last: int, slots: np.ndarray, buffer: np.ndarray) -> None:
    width = last - first
    for n in range(len(slots)):
        for c in range(width):
            buffer[n * width + c] = nodes[slots[n], first + c]


@njit(cache=True)
def _add_in_rank_order(
    nodes: np.ndarray,
    first: int,
    last: int,
    own_slots: np.ndarray,
    own: np.ndarray,
    slots: np.ndarray,
    lower: np.ndarray,
    buffer: np.ndarray,
) -> None:
    """Rows of lower ranks, this rank's, rows of higher ranks; `lower` counts the rows that come before this rank's."""
    width = last - first
    for n in range(len(own_slots)):
        for c in range(width):
            nodes[own_slots[n], first + c] = 0.0
    for n in range(lower):
        for c in range(width):
            nodes[slots[n], first + c] += buffer[n * width + c]
    for n in range(len(own_slots)):
        for c in range(width):
            nodes[own_slots[n], first + c] += own[n * width + c]
    for n in range(lower, len(slots)):
        for c in range(width):
            nodes[slots[n], first + c] += buffer[n * width + c]


class _Messages:
    """Persistent requests between neighbours for buffers of known sizes."""

    def __init__(
        self, comm: MPI.Comm, neighbours: Sequence[int], tag: int, sent: list[int], received: list[int]
    ) -> None:
        self.outgoing, self.incoming = np.empty(sum(sent)), np.empty(sum(received))
        self._receives = self._requests(comm.Recv_init, neighbours, received, self.incoming, tag)
        self._sends = self._requests(comm.Send_init, neighbours, sent, self.outgoing, tag)
        self._all = self._receives + self._sends
        self._finalizer = weakref.finalize(self, _release, self._all.copy())

    @staticmethod
    def _requests(
        make: Callable[..., MPI.Prequest],
        neighbours: Sequence[int],
        counts: Sequence[int],
        buffer: np.ndarray,
        tag: int,
    ) -> list[MPI.Prequest]:
        requests, at = [], 0
        for rank, count in zip(neighbours, counts):
            if count:
                requests.append(make([buffer[at : at + count], MPI.DOUBLE], rank, tag))
            at += count
        return requests

    def receive(self) -> None:
        MPI.Prequest.Startall(self._receives)

    def send(self) -> None:
        MPI.Prequest.Startall(self._sends)

    def wait(self) -> None:
        MPI.Prequest.Waitall(self._all)


class NodeSum:
    """Partial sums of nodes added up over the ranks that have them, in the order of ranks. Made by `RankGrid.sum`."""

    def __init__(self, comm: MPI.Comm, sharing: Sharing, nodes: np.ndarray, columns: tuple[int, int], tag: int) -> None:
        self._nodes, self._columns = nodes, columns
        width, counts = columns[1] - columns[0], [len(slots) for slots in sharing.shared]
        self._slots = np.concatenate([np.zeros(0, np.int32), *sharing.shared])
        self._own_slots = np.unique(self._slots)
        self._own = np.empty(width * len(self._own_slots))
        self._lower = sum(count for rank, count in zip(sharing.neighbours, counts) if rank < comm.rank)
        sizes = [width * count for count in counts]
        self._messages = _Messages(comm, sharing.neighbours, tag, sizes, sizes)
        self.bytes_sent = self._messages.outgoing.nbytes

    def start(self) -> None:
        """Send this rank's partial sums; the columns must stay as they are until the finish."""
        if len(self._slots):
            self._messages.receive()
            _pack(self._nodes, *self._columns, self._slots, self._messages.outgoing)
            self._messages.send()

    def finish(self) -> None:
        """Wait for the others' and add up."""
        if len(self._slots):
            _pack(self._nodes, *self._columns, self._own_slots, self._own)
            self._messages.wait()
            _add_in_rank_order(
                self._nodes,
                *self._columns,
                self._own_slots,
                self._own,
                self._slots,
                self._lower,
                self._messages.incoming,
            )
