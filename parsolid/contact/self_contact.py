"""Contact within one body: which of its pairs may touch, and the threshold of particles beside broken bonds.

Pairs may touch whose distance in the reference is at least twice the kernel's reach, so that compression to a stretch
of one half brings no other pairs within reach, and pairs whose bond has broken. The colour of broken neighbours in the
reference is the least threshold of a particle: nothing acts in the reference, however many of its bonds are broken.
"""

from typing import Any

import numpy as np

from parsolid.contact.bodies import ContactBodies, ContactLaw
from parsolid.contact.broad_phase import BroadPhase
from parsolid.contact.kernel import norm, shapes
from parsolid.methods.protocol import BrokenPairs, ParticleSystem

_APART = 2.0


class SelfContact:
    """Broken pairs of the systems with contact within one body, as of the last `update`."""

    def __init__(self, contact: ContactBodies, systems: list[ParticleSystem]) -> None:
        self.systems = systems
        self.touching = [bool(contact.alone[list(system.bodies)].any()) for system in systems]
        self.broken: list[BrokenPairs | None] = [None] * len(systems)
        self._keys = np.zeros(0, np.int64)

    def update(self) -> None:
        """Get the broken pairs of all systems."""
        keys = [np.zeros(0, np.int64)]
        for index, system in enumerate(self.systems):
            if self.touching[index]:
                found = self.broken[index] = system.broken_pairs()
                if found is not None:
                    mine = system.particles.owned_rows("identifier")[found.row]
                    keys.append(_key(mine.astype(np.int64), found.identifier))
        self._keys = np.concatenate(keys)

    def excluded(self, boxes: BroadPhase, pair: Any, row: Any, neighbour: Any, reference: Any, particle: Any) -> Any:
        """Which pairs (row, neighbour) of one body may not touch although they are near. pair, reference, particle, all
        with ghosts: body pair, reference position [m] and identifier of each candidate."""
        number = pair[row]
        close = np.linalg.norm(reference[row] - reference[neighbour], axis=1) < _APART * boxes.reach[number]
        result = (boxes.own == boxes.other)[number] & close
        if len(self._keys):
            here = np.flatnonzero(result)
            result[here] = ~np.isin(_key(particle[row[here]], particle[neighbour[here]]), self._keys)
        return result

    def least_thresholds(self, number: int, law: ContactLaw, rows: np.ndarray, dimension: int) -> np.ndarray | None:
        """Colour (k,) in the reference of the broken neighbours of rows of a system; None without broken pairs."""
        found = self.broken[number]
        if found is None or not len(found.row):
            return None
        count = self.systems[number].particles.owned
        weight = norm(dimension, law.reach) * found.volume * shapes(found.distance / law.reach)
        return np.asarray(np.bincount(found.row, weight, minlength=count)[rows])


def _key(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """One number for each ordered pair of identifiers."""
    return np.asarray(first * np.int64(1 << 31) + second)
