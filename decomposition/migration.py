"""Hand the rows of arrays to their new owners."""

from zlib import crc32

import numpy as np
from mpi4py import MPI
from numba import njit

from decomposition.talking import TALKING


@njit(cache=True)
def _order_by_owner(owner: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Rows in the order of their owner, then as they came."""
    cursor = np.zeros(len(counts), np.int64)
    cursor[1:] = np.cumsum(counts)[:-1]
    order = np.empty(len(owner), np.int64)
    for i in range(len(owner)):
        order[cursor[owner[i]]] = i
        cursor[owner[i]] += 1
    return order


def _fault(comm: MPI.Comm, owner: np.ndarray, arrays: dict[str, np.ndarray]) -> str | None:
    if owner.ndim != 1 or owner.dtype.kind not in "iu":
        return f"owner: expected integers of shape (n,), found {owner.dtype} of shape {owner.shape}"
    if len(owner) and not 0 <= owner.min() <= owner.max() < comm.size:
        return f"owner: expected ranks 0 to {comm.size - 1}, found {owner.min()} to {owner.max()}"
    for name, array in arrays.items():
        if array.ndim == 0 or len(array) != len(owner):
            return f"arrays[{name!r}]: expected {len(owner)} rows, as owner has, found shape {array.shape}"
        if array.dtype.hasobject:
            return f"arrays[{name!r}]: expected plain numbers, found {array.dtype}"
    return None


def _counts(comm: MPI.Comm, owner: np.ndarray, arrays: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Rows to and from each rank; every rank raises ValueError when the arrays of one are wrong or differ in kind."""
    fault = _fault(comm, owner, arrays)
    kinds = [(name, array.dtype.str, array.shape[1:]) for name, array in arrays.items()]
    outgoing = np.zeros((comm.size, 2), np.int64)
    outgoing[:, 1] = -1 if fault else crc32(repr(kinds).encode())
    if fault is None:
        outgoing[:, 0] = np.bincount(owner, minlength=comm.size)
    incoming = np.empty_like(outgoing)
    with TALKING:
        comm.Alltoall(outgoing, incoming)
    if fault:
        raise ValueError(fault)
    for rank in np.flatnonzero(incoming[:, 1] != outgoing[:, 1]):
        wrong = "arguments that are wrong there" if incoming[rank, 1] < 0 else "other names, types or shapes of rows"
        raise ValueError(f"arrays: expected the same on all ranks, found that rank {rank} has {wrong}; here {kinds}")
    return outgoing[:, 0].copy(), incoming[:, 0].copy()


def migrate(comm: MPI.Comm, owner: np.ndarray, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Send row i of every array to rank owner[i]; collective.

    owner (n,) integers; arrays: name -> (n, ...) of any plain type and strides, the same names, types and row shapes in
    the same order on all ranks. Returns new contiguous arrays, rows ordered by the rank they come from, then as they
    were there. One array travels at a time, and rows that stay are copied once. Raises ValueError, on all ranks, for
    wrong arguments.
    """
    owner = np.asarray(owner)
    arrays = {name: np.asarray(array) for name, array in arrays.items()}
    to, source = _counts(comm, owner, arrays)
    if comm.size == 1:
        return {name: array.copy() for name, array in arrays.items()}
    order = _order_by_owner(owner, to)
    sent_before, received_before = (np.concatenate(([0], np.cumsum(counts))) for counts in (to, source))
    here = comm.rank
    staying = order[sent_before[here] : sent_before[here + 1]]
    leaving = np.delete(order, slice(sent_before[here], sent_before[here + 1]))
    kept_at = slice(received_before[here], received_before[here + 1])
    to[here] = 0
    incoming = source.copy()
    incoming[here] = 0
    route = leaving, staying, to, incoming, received_before, kept_at
    return {name: _move(comm, array, *route) for name, array in arrays.items()}


def _move(
    comm: MPI.Comm,
    array: np.ndarray,
    leaving: np.ndarray,
    staying: np.ndarray,
    to: np.ndarray,
    incoming: np.ndarray,
    received_before: np.ndarray,
    kept_at: slice,
) -> np.ndarray:
    result = np.empty((received_before[-1], *array.shape[1:]), array.dtype)
    result[kept_at] = array[staying]
    packed = np.ascontiguousarray(array[leaving])
    # counted in rows, because bytes may not fit the 32-bit counts of MPI
    row = MPI.BYTE.Create_contiguous(array.dtype.itemsize * int(np.prod(array.shape[1:]))).Commit()
    try:
        sent_at = np.cumsum(to) - to
        with TALKING:
            comm.Alltoallv([packed, (to, sent_at), row], [result, (incoming, received_before[:-1]), row])
    finally:
        row.Free()
    return result
