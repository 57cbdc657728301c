"""Lists of a rank's pairs and the order in which passes walk them, whoever made the lists.

Pairs of owned particles are swept while the ghosts' values travel, pairs with ghosts and with mirror images after that.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from decomposition.halo import Halo
from parsolid.pairs.lists import InnerList, OneSidedList


class PairLists:
    """inner, rim, mirror: lists of pairs of owned particles, with ghosts, with images; rim and mirror may be None."""

    comm: Any
    particles: Any
    halo: Halo
    inner: InnerList
    rim: OneSidedList | None = None
    mirror: OneSidedList | None = None

    @property
    def owned(self) -> int:
        """Particles of this rank."""
        return self.halo.owned

    @property
    def directed_pairs(self) -> int:
        """Interactions counted once a particle, over this rank's particles."""
        return sum((2 if pairs is self.inner else 1) * len(pairs.neighbour) for pairs in self._all())

    def _all(self) -> list[Any]:
        return [pairs for pairs in (self.inner, self.rim, self.mirror) if pairs is not None]

    def arrays(self) -> list[np.ndarray]:
        """Arrays of the lists, for what counts memory."""
        arrays = [array for pairs in self._all() for array in pairs[:3]]
        return arrays + ([*(self.mirror.images or ())] if self.mirror is not None else [])

    def sweep(self, apply: Callable[[Any], None], message: str | None = None) -> None:
        """apply(list) to inner pairs while a message of the particles travels, then to pairs with ghosts and with
        images."""
        if message is not None:
            self.particles.send(message)
        apply(self.inner)
        if message is not None:
            self.particles.receive(message)
        for pairs in (self.rim, self.mirror):
            if pairs is not None:
                apply(pairs)
