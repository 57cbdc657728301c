"""What methods have in common whose particles act on one another in pairs."""

import numpy as np

from parsolid.methods.protocol import ParticleSystem
from parsolid.pairs.pair_lists import PairLists


class PairMethod(ParticleSystem):
    """A method with pair lists, whose particles have the fields "mass" [kg] and "share"."""

    pairs: PairLists

    @property
    def mass(self) -> np.ndarray:  # type: ignore[override]
        """Mass (owned,) [kg], of the whole particle where it lies on a mirror plane."""
        return self.particles.owned_rows("mass")

    @property
    def share(self) -> np.ndarray:  # type: ignore[override]
        """The part (owned,) of a particle on this side of mirror planes."""
        return self.particles.owned_rows("share")

    @property
    def directed_pairs(self) -> int:  # type: ignore[override]
        """Interactions counted once a particle."""
        return self.pairs.directed_pairs

    @property
    def communication_seconds(self) -> float:  # type: ignore[override]
        """Spent on sending and receiving."""
        return self.particles.communication_seconds

    def numbers(self) -> dict[str, int]:
        """Ghosts and interactions."""
        return {"ghosts": self.particles.ghosts, "interactions": self.pairs.directed_pairs}
