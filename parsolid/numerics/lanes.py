"""Four float64 lanes as one numba value: explicit SIMD for the pair passes and the particle updates.

A `Lanes` value maps to LLVM's <4 x double>. Pair kernels use it as a vector (x, y, z, unused) or as one
column of a matrix; particle kernels use it as four neighbouring particles, so that material laws written
in plain arithmetic run on floats and on lanes alike. LLVM splits the lanes where the processor is narrower.

What kernels call is in `lanes_lowering`, which is imported when one is compiled.
"""

import numpy as np

from decomposition.deferred import Deferred, Elsewhere, register_jitable, with_numba

WIDTH = 4
# what their type is called where implementations are chosen by types
LANES = "Lanes"


def _lowering():
    """Imported with numba, for operators on lanes; kernels are compiled from its text."""
    from parsolid.numerics import lanes_lowering

    return lanes_lowering


with_numba(_lowering)
_there = Elsewhere("parsolid.numerics.lanes_lowering")
fused, broadcast, lane, from_floats = _there.fused, _there.broadcast, _there.lane, _there.from_floats
load, store, store_first = _there.load, _there.store, _there.store_first
without_fourth, transpose, all_positive = _there.without_fourth, _there.transpose, _there.all_positive
horizontal_sums, last_two_roots = _there.horizontal_sums, _there.last_two_roots


def shuffle(*indices):
    """What puts lane indices[k] of its first argument, or indices[k] - 4 of its second, into lane k."""
    return Deferred(lambda: _lowering().shuffle(*indices))


def swizzle(*indices):
    """What puts lane indices[k] of its argument into lane k."""
    return Deferred(lambda: _lowering().swizzle(*indices))


@register_jitable
def total(value):
    """Sum over the four lanes."""
    return (lane(value, 0) + lane(value, 1)) + (lane(value, 2) + lane(value, 3))


def padded(count: int) -> int:
    """The least multiple of the lane width that is at least count."""
    return -(-count // WIDTH) * WIDTH


def aligned_zeros(shape, dtype=np.float64) -> np.ndarray:
    """A zeroed array whose first element lies on a 64-byte boundary, so that four lanes do not straddle cache lines."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    buffer = np.zeros(size + 64, np.uint8)
    offset = -buffer.ctypes.data % 64
    return buffer[offset : offset + size].view(dtype).reshape(shape)
