"""Arrays of any length between a rank and its neighbours, which do not know before how much comes."""

import numpy as np
from mpi4py import MPI

from .talking import TALKING


def swap(comm: MPI.Comm, ranks: list[int], outgoing: list[np.ndarray], tag: int) -> list[np.ndarray]:
    """Send each rank its array and return theirs, in the order of the ranks, which all do the same.

    outgoing: an array (n, ...) a rank, n different for each, rows of one shape and plain type on both sides. One
    message goes each way, counted in rows, because bytes may not fit the 32-bit counts of MPI.
    """
    if not ranks:
        return []
    kind, shape = outgoing[0].dtype, outgoing[0].shape[1:]
    row = MPI.BYTE.Create_contiguous(kind.itemsize * int(np.prod(shape))).Commit()
    incoming, status = [], MPI.Status()
    try:
        with TALKING:
            packed = [np.ascontiguousarray(array) for array in outgoing]
            requests = [comm.Isend([array, len(array), row], rank, tag) for array, rank in zip(packed, ranks)]
            for rank in ranks:
                comm.Probe(rank, tag, status)
                incoming.append(np.empty((status.Get_count(row), *shape), kind))
                comm.Recv([incoming[-1], len(incoming[-1]), row], rank, tag)
            MPI.Request.Waitall(requests)
    finally:
        row.Free()
    return incoming
