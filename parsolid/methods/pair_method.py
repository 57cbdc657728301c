"""What methods have in common whose particles act on one another in pairs."""

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_IMPULSE
from parsolid.methods.leapfrog import ImpulseAtEnd
from parsolid.methods.protocol import ParticleSystem
from parsolid.pairs.pair_lists import PairLists


class PairMethod(ParticleSystem):
    """A method with pair lists, whose particles have the field "mass" [kg], and "share" where planes cut any."""

    pairs: PairLists

    def impulse_at_end(self, step: float) -> ImpulseAtEnd | None:
        """Of the step [s] under way, before its closing kick."""
        if EXTERNAL_IMPULSE not in self.particles:
            return None
        return ImpulseAtEnd(self.particles, self.substeps * step)

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
