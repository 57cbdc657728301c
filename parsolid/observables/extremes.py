"""The least and the greatest of all particles."""

import numpy as np

from parsolid.observables.declared import Sampler, Watched, quantity


@quantity("minimum_jacobian")
class MinimumJacobian(Sampler):
    """The least Jacobian."""

    reduction = "minimum"

    def part(self, watched: Watched) -> np.ndarray:
        """This rank's."""
        return np.array([watched.field("jacobian").min(initial=np.inf)])


@quantity("maximum_speed")
class MaximumSpeed(Sampler):
    """The greatest speed [m/s]."""

    reduction = "maximum"

    def part(self, watched: Watched) -> np.ndarray:
        """This rank's."""
        return np.array([np.linalg.norm(watched.rows("velocity"), axis=1).max(initial=0.0)])
