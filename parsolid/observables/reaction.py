"""What a support or a driven surface takes."""

from typing import Any

import numpy as np

from parsolid.observables.declared import Sampler, Watched


class ReactionForce(Sampler):
    """Force [N] and moment [N m] of a condition on the bodies, mean over the last step; columns of a boundary's name.

    In 2-D they are per metre of thickness, and the moment is about the axis out of the plane.
    """

    def part(self, watched: Watched) -> np.ndarray:
        """This rank's."""
        systems: list[Any] = watched.systems
        found = [system.reaction(self.name) for system in systems]
        return np.asarray(sum((one for one in found if one is not None), np.zeros(len(self.columns))))
