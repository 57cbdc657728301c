"""Reductions over ranks: sums, and minima that are asked for a step ahead."""

from collections.abc import Iterable
from math import inf, isnan
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI

from decomposition.timer import COMMUNICATION

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def sums(comm: MPI.Comm, values: "ArrayLike") -> np.ndarray:
    """Sum of each value over all ranks, the same on all, in an array of the same shape; one Allreduce. Collective."""
    values = np.array(values)
    if comm.size == 1:
        return values
    result = np.empty_like(values)
    with COMMUNICATION:
        comm.Allreduce(values, result, MPI.SUM)
    return result


class MinimumAhead:
    """Minima over all ranks, begun at one moment and fetched at a later one, while the ranks work on.

    comm: an intracommunicator; length: how many minima at once. Every begin needs its result before the next begin.
    """

    def __init__(self, comm: MPI.Comm, length: int) -> None:
        self._comm = comm
        self._values: Any = np.empty(length)
        self._minima: Any = np.empty(length)
        # a few numbers of Python go to and from an array fastest so
        self._numbers = Struct(f"{length}d")
        # as MPI wants them, so that it does not ask the arrays each time
        self._buffers = [self._values, MPI.DOUBLE], [self._minima, MPI.DOUBLE]
        # alone, there is nobody to ask, and the values of a begin are what is there
        self._request: MPI.Request | tuple[float, ...] | None = None

    @property
    def pending(self) -> bool:
        """True between begin and result."""
        return self._request is not None

    def begin(self, values: Iterable[float]) -> None:
        """Start the reduction of this rank's values (length,); collective. NaN counts as -inf, so none misses it."""
        if self._request is not None:
            raise RuntimeError("MinimumAhead.begin: expected the last result to be fetched first, found it pending")
        values = tuple(values)
        if isnan(sum(values)):
            values = tuple(-inf if isnan(value) else value for value in values)
        if self._comm.size == 1:
            self._request = values
            return
        self._numbers.pack_into(self._values, 0, *values)
        self._request = self._comm.Iallreduce(*self._buffers, MPI.MIN)

    def result(self) -> tuple[float, ...]:
        """Wait for the minima, as many as were begun."""
        if self._request is None:
            raise RuntimeError("MinimumAhead.result: expected a begin before it, found none pending")
        request, self._request = self._request, None
        if isinstance(request, tuple):
            return request
        request.Wait()
        return self._numbers.unpack_from(self._minima)
