"""What all methods have that walk lists of pairs."""

from typing import Any

import numpy as np

from parsolid.methods.protocol import ParticleSystem


class PairedSystem(ParticleSystem):
    """A method whose particles act on one another in pairs of lists.

    Set by the method: pairs.
    """

    pairs: Any  # of its own kind of `pairs.pair_lists.PairLists`

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
