"""As many float64 lanes as the processor's registers have, eight or four: `numerics.lanes` for passes over pairs in
blocks of so many particles.

What kernels call is in `wide_lanes_lowering`, which is imported when one is compiled.
"""

from llvmlite import binding

from decomposition.deferred import Elsewhere, with_numba

WIDE = 8 if binding.get_host_cpu_features().get("avx512f") else 4


def _lowering():
    """Imported with numba, for operators on lanes."""
    from parsolid.numerics import wide_lanes_lowering

    return wide_lanes_lowering


with_numba(_lowering)
_there = Elsewhere("parsolid.numerics.wide_lanes_lowering")
broadcast_wide, fused_wide = _there.broadcast_wide, _there.fused_wide
load_wide, store_wide = _there.load_wide, _there.store_wide
load_row_wide, store_first_wide = _there.load_row_wide, _there.store_first_wide
all_positive_wide, halves, joined = _there.all_positive_wide, _there.halves, _there.joined
first_lanes = _there.first_lanes
