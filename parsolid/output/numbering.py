"""Numbers of some of the particles, in the order of their identifiers, that no rank knows all of."""

import numpy as np
from mpi4py import MPI

from decomposition.migration import migrate


def numbers_of(comm: MPI.Intracomm, identifier: np.ndarray) -> np.ndarray:
    """0 to m - 1 (k,) for m particles of all ranks, rising with their identifiers (k,); collective."""
    largest = np.array(identifier.max(initial=-1), np.int64)
    comm.Allreduce(MPI.IN_PLACE, largest, op=MPI.MAX)
    owner = identifier * comm.size // (int(largest) + 1) if largest >= 0 else identifier
    mine = np.arange(len(identifier))
    there = migrate(comm, owner, {"identifier": identifier, "rank": np.full(len(mine), comm.rank), "row": mine})
    order = np.argsort(there["identifier"], kind="stable")
    first = comm.exscan(len(order)) or 0
    numbers = np.empty(len(order), np.int64)
    numbers[order] = first + np.arange(len(order))
    back = migrate(comm, there["rank"], {"row": there["row"], "number": numbers})
    result = np.empty(len(mine), np.int64)
    result[back["row"]] = back["number"]
    return result
