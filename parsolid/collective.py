"""Errors that all ranks raise together, so that none waits for another that has stopped."""

from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from decomposition.timer import COMMUNICATION

Value = TypeVar("Value", float, int, np.ndarray)


class SolverError(ValueError):
    """A scene that cannot be set up, found after its file was read; the same message on every rank."""


class Stopped(Exception):
    """A solution that is given up, as the run is to stop; on all ranks at once."""


def raise_together(comm: MPI.Comm, fault: str | None, error: type[Exception] = SolverError) -> None:
    """Raise `error` on every rank with the fault of the lowest rank that has one; collective."""
    first = comm.allreduce(comm.rank if fault is not None else comm.size, MPI.MIN)
    if first < comm.size:
        raise error(comm.bcast(fault, root=first))


def minimum(comm: MPI.Comm, value: Value) -> Value:
    """Least of a number or of each entry of a float array over all ranks; collective."""
    least: Value = _reduce(comm, value, MPI.MIN)
    return least


def maximum(comm: MPI.Comm, value: Value) -> Value:
    """Greatest of a number or of each entry of a float array over all ranks; collective."""
    greatest: Value = _reduce(comm, value, MPI.MAX)
    return greatest


def anywhere(comm: MPI.Comm, flag: bool) -> bool:
    """True when the flag is true on any rank; collective."""
    with COMMUNICATION:
        return bool(comm.allreduce(bool(flag), MPI.LOR))


def _reduce(comm: MPI.Comm, value: Any, operation: MPI.Op) -> Any:
    if not isinstance(value, np.ndarray):
        with COMMUNICATION:
            return comm.allreduce(value, operation)
    result = np.empty_like(value)
    with COMMUNICATION:
        comm.Allreduce(np.ascontiguousarray(value), result, operation)
    return result
