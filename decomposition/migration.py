"""Hand the rows of arrays to their new owners."""

from zlib import crc32

import numpy as np
from mpi4py import MPI

from .plan import send_to_some
from .timer import COMMUNICATION


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


def _check(comm: MPI.Comm, owner: np.ndarray, arrays: dict[str, np.ndarray]) -> None:
    """Every rank raises ValueError when the arrays of one are wrong or differ in kind."""
    fault = _fault(comm, owner, arrays)
    kinds = [(name, array.dtype.str, array.shape[1:]) for name, array in arrays.items()]
    kind = crc32(repr(kinds).encode())
    mine = np.array([comm.size if fault is None else comm.rank, *((0, 0) if fault else (kind, -kind))])
    least = np.empty_like(mine)
    with COMMUNICATION:
        comm.Allreduce(mine, least, MPI.MIN)
    if fault:
        raise ValueError(fault)
    if least[0] < comm.size:
        raise ValueError(f"arrays: rank {least[0]} has arguments that are wrong there")
    if least[1] != -least[2]:
        found = "other names, types or shapes of rows on some"
        raise ValueError(f"arrays: expected the same on all ranks, found {found}; here {kinds}")


def migrate(comm: MPI.Comm, owner: np.ndarray, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Send row i of every array to rank owner[i]; collective.

    owner (n,) integers; arrays: name -> (n, ...) of any plain type and strides, the same names, types and row shapes in
    the same order on all ranks. Returns new contiguous arrays, rows ordered by the rank they come from, then as they
    were there. All that a row has travels as one record, in one message to each rank that gets any. Raises ValueError,
    on all ranks, for wrong arguments.
    """
    owner = np.asarray(owner)
    arrays = {name: np.asarray(array) for name, array in arrays.items()}
    _check(comm, owner, arrays)
    if comm.size == 1:
        return {name: array.copy(order="C") for name, array in arrays.items()}
    record = np.dtype([(name, array.dtype, array.shape[1:]) for name, array in arrays.items()])
    order = np.argsort(owner, kind="stable")
    targets, first = np.unique(owner[order], return_index=True)
    leaving = dict(zip(targets.tolist(), np.split(order, first[1:])))
    staying = leaving.pop(comm.rank, np.zeros(0, np.int64))
    packed = [_packed(rows, arrays, record) for rows in leaving.values()]
    sources, come = send_to_some(comm, list(leaving), packed, np.empty(0, record))
    lower = int(np.searchsorted(sources, comm.rank))
    return {
        name: np.concatenate(
            [*(one[name] for one in come[:lower]), array[staying], *(one[name] for one in come[lower:])]
        )
        for name, array in arrays.items()
    }


def _packed(rows: np.ndarray, arrays: dict[str, np.ndarray], record: np.dtype) -> np.ndarray:
    """Records (k,) of some rows."""
    result = np.empty(len(rows), record)
    for name, array in arrays.items():
        result[name] = array[rows]
    return result
