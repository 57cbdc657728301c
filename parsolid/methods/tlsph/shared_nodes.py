"""Nodes that several bodies of one mesh share: each body has a particle there, with strain and stress of its own, and
all of them move as one.

Forces on the particles of a node are shared in proportion to their masses, so that they have one acceleration, and
every sum of forces, powers and impulses is that of the node. So materials meet as in finite elements: displacements are
continuous, and stresses are those of each body's own elements.
"""

from typing import Any

import numpy as np


class SharedNodes:
    """Of a rank: own (k,) rows of particles at shared nodes, rows (k, bodies) of all particles there, which may be
    ghosts, -1 where a body has none, in the order of identifiers, and the part (k,) of the node's mass that is theirs.
    """

    def __init__(self, halo: Any, own: np.ndarray, rows: np.ndarray, mass: np.ndarray) -> None:
        """halo: in which all of these particles are ghosts; mass (owned,) [kg]. Collective."""
        self.own, self.rows, self.there = own, rows, rows >= 0
        self.mass = mass[own]
        self.total = self._summed(halo.with_ghosts(np.ascontiguousarray(mass)[:, None]))[:, 0]
        # two vectors
        self._sent = np.zeros((halo.owned + halo.ghosts, 6))
        self._message = halo.forward(self._sent)

    def _summed(self, values: np.ndarray) -> np.ndarray:
        """Sums (k, c) of values (rows, c) over the particles of each node, in their order."""
        result = np.zeros((len(self.own), values.shape[1]))
        for rows, there in zip(self.rows.T, self.there.T):
            result[there] += values[rows[there]]
        return result

    def differ(self, values: np.ndarray) -> bool:
        """Whether values (d, owned or more) are not the same of all particles at a node of this rank; collective."""
        self._sent[self.own, : len(values)] = values[:, self.own].T
        self._message.now()
        own = self._sent[self.own]
        return any(bool((self._sent[r[t]] != own[t]).any()) for r, t in zip(self.rows.T, self.there.T))

    def share(self, *forces: np.ndarray) -> None:
        """Give each particle its part of the sum of forces (d, owned or more), two at most, at its node; collective."""
        columns = [slice(3 * i, 3 * i + len(force)) for i, force in enumerate(forces)]
        for force, column in zip(forces, columns):
            self._sent[self.own, column] = force[:, self.own].T
        self._message.now()
        total = self._summed(self._sent) * (self.mass / self.total)[:, None]
        for force, column in zip(forces, columns):
            force[:, self.own] = total[:, column].T

    def move_as_one(self, *vectors: np.ndarray) -> None:
        """Give all particles of a node the mean by their masses of vectors (d, owned or more); collective."""
        for vector in vectors:
            vector[:, self.own] *= self.mass
        self.share(*vectors)
        for vector in vectors:
            vector[:, self.own] /= self.mass
