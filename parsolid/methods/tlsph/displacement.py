"""The gradient of the displacement by the scheme's own operator."""

from typing import Any

import numpy as np


def displacement_gradient(system: Any) -> np.ndarray:
    """grad u (owned, d d) by the gradient pass, with the displacement in the velocity's place."""
    velocity, d = system.particles["velocity"], system.dimension
    kept = velocity.copy()
    velocity[:] = system.particles["position"] - system.particles["reference_position"]
    sums = system.pairs.gradient("motion")
    velocity[:] = kept
    columns = sums[: system.owned].reshape(system.owned, d, -1)[:, :, :d].swapaxes(1, 2).copy()
    sums[:] = 0.0
    L = system.particles.owned_rows("correction").reshape(system.owned, d, d)
    volume = system.particles.owned_rows("pair_volume")[:, None, None]
    return (columns @ L.swapaxes(1, 2) / volume).reshape(system.owned, d * d)
