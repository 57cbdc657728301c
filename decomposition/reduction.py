"""Reductions over ranks: sums, minima that are asked for a step ahead, and sums whose bits never change."""

from collections.abc import Iterable
from math import inf, isnan
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from numba import njit

from decomposition.timer import COMMUNICATION

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# a double is an integer of 53 bits times 2**(exponent - 1074): 2098 bits in limbs of 32, and room for carries
_LIMB_BITS = 32
_LIMBS = 68
_LEAST_EXPONENT = 1074
# additions of less than 2**33 that a limb of 63 bits surely takes
_BETWEEN_CARRIES = 1 << 29
_NAN, _POSITIVE, _NEGATIVE = _LIMBS, _LIMBS + 1, _LIMBS + 2


def sums(comm: MPI.Comm, values: "ArrayLike") -> np.ndarray:
    """Sum of each value over all ranks, the same on all, in an array of the same shape; one Allreduce. Collective."""
    values = np.array(values)
    if comm.size == 1:
        return values
    result = np.empty_like(values)
    with COMMUNICATION:
        comm.Allreduce(values, result, MPI.SUM)
    return result


@njit(cache=True)
def _carry(limbs: np.ndarray) -> None:
    """Bring all limbs but the last into 0 .. 2**32 - 1."""
    for k in range(_LIMBS - 1):
        limbs[k + 1] += limbs[k] >> _LIMB_BITS
        limbs[k] &= 0xFFFFFFFF


@njit(cache=True)
def _accumulate(values: np.ndarray, limbs: np.ndarray) -> None:
    """Add doubles exactly; values that are not finite are counted behind the limbs."""
    bits = values.view(np.int64)
    pending = 0
    for i in range(len(bits)):
        exponent = (bits[i] >> 52) & 0x7FF
        mantissa = bits[i] & 0xFFFFFFFFFFFFF
        negative = bits[i] < 0
        if exponent == 0x7FF:
            limbs[_NAN if mantissa else (_NEGATIVE if negative else _POSITIVE)] += 1
            continue
        if exponent:
            mantissa |= 1 << 52
            exponent -= 1
        first, shift = exponent >> 5, exponent & 31
        # (mantissa << shift) has up to 84 bits: three limbs
        low = (mantissa & 0xFFFFFFFF) << shift
        high = (mantissa >> 32) << shift
        parts = (low & 0xFFFFFFFF, (low >> 32) + (high & 0xFFFFFFFF), high >> 32)
        for k in range(3):
            limbs[first + k] += -parts[k] if negative else parts[k]
        pending += 1
        if pending == _BETWEEN_CARRIES:
            _carry(limbs)
            pending = 0
    _carry(limbs)


def _rounded(limbs: np.ndarray) -> float:
    """The double nearest to the exact sum."""
    if limbs[_NAN] or (limbs[_POSITIVE] and limbs[_NEGATIVE]):
        return float("nan")
    if limbs[_POSITIVE] or limbs[_NEGATIVE]:
        return float("inf") if limbs[_POSITIVE] else float("-inf")
    total = sum(int(limb) << (_LIMB_BITS * k) for k, limb in enumerate(limbs[:_LIMBS]))
    try:
        return total / (1 << _LEAST_EXPONENT)
    except OverflowError:
        return float("inf") if total > 0 else float("-inf")


def ordered_sum(comm: MPI.Comm, values: np.ndarray) -> float | np.ndarray:
    """The double nearest to the exact sum over all ranks: the same bits for any order and number of ranks. Collective.

    values (n,) float64, n may differ between ranks and be 0: returns a float. values (n, c), the same c on all ranks:
    the sum of each column, (c,). NaN or infinite values give NaN or the infinity. Raises ValueError for another shape.
    Source: U. Kulisch, "Very fast and exact accumulation of products", Computing 91 (2011): a long fixed-point number.
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim not in (1, 2):
        raise ValueError(f"values: expected shape (n,) or (n, c), found {values.shape}")
    columns = values.reshape(len(values), -1) if values.ndim == 2 else values[:, None]
    limbs = np.zeros((columns.shape[1], _LIMBS + 3), np.int64)
    for column, total in zip(columns.T, limbs):
        _accumulate(np.ascontiguousarray(column), total)
    with COMMUNICATION:
        comm.Allreduce(MPI.IN_PLACE, limbs, MPI.SUM)
    result = np.array([_rounded(total) for total in limbs])
    return float(result[0]) if values.ndim == 1 else result


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
