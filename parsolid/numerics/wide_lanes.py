"""As many float64 lanes as the processor's registers have, eight or four: `numerics.lanes` for passes over pairs in
blocks of so many particles.

What kernels call is in `wide_lanes_lowering`, which is imported when one is compiled.
"""

from decomposition.deferred import Elsewhere, with_numba
from decomposition.machine_code import features

# what a kernel's file is named by: a file of eight lanes must not be found where there are four
WIDE = 8 if "avx512f" in features() else 4


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
