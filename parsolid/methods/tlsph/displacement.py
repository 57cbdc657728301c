"""The gradient of the displacement by the scheme's own operator."""

from typing import Any

import numpy as np

from parsolid.collective import anywhere


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


def complete_strain(system: Any, derived: np.ndarray) -> None:
    """H and J at time 0 from the deformation gradient F; collective.

    derived (n,): particles whose F is that of their displacement, by the scheme's own gradient.
    """
    rows, d, owned = system.particles.owned_rows, system.dimension, system.owned
    if anywhere(system.comm, bool(derived.any())):
        rows("deformation_gradient")[derived] += displacement_gradient(system)[derived]
    F = np.zeros((owned, 3, 3))
    F[:, :d, :d] = rows("deformation_gradient").reshape(owned, d, d)
    F[:, d:, d:] = 1.0
    rows("jacobian")[:] = np.linalg.det(F)
    if "cofactor" in system.particles:
        cofactor = np.cross(F[:, (1, 2, 0)], F[:, (2, 0, 1)])
        rows("cofactor")[:] = cofactor.reshape(owned, 9)
