"""What methods have in common whose particles act on one another in pairs."""

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_IMPULSE
from parsolid.methods.protocol import ParticleSystem
from parsolid.pairs.pair_lists import PairLists


class PairMethod(ParticleSystem):
    """A method with pair lists, whose particles have the field "mass" [kg], and "share" where planes cut any."""

    pairs: PairLists

    def add_external_impulse(self) -> None:
        """Add the impulses of a step to the velocities, but for components that are held."""
        impulse = self.particles.owned_rows(EXTERNAL_IMPULSE)
        if impulse.any():
            change, held = impulse / (self.mass * self.share)[:, None], self.held_components()
            self.particles.owned_rows("velocity")[:] += change if held is None else np.where(held, 0.0, change)
            impulse[:] = 0.0

    @property
    def directed_pairs(self) -> int:  # type: ignore[override]
        """Interactions counted once a particle."""
        return self.pairs.directed_pairs

    def numbers(self) -> dict[str, int]:
        """Ghosts and interactions."""
        return {"ghosts": self.particles.ghosts, "interactions": self.pairs.directed_pairs}

    def arrays(self) -> list[np.ndarray]:
        """Pair lists."""
        return self.pairs.arrays()
