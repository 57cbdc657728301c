"""Boxes with a round hole (a ball in 3-D): a Cartesian lattice of cells of which those with their centre outside it are
kept.
"""

import numpy as np

from parsolid.particles.lattices.lattice import lines_of, staircase
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.bodies import FilledShape


class PerforatedFilling:
    """A box without what is within a radius of a point; the hole's surface is a staircase.

    Ids run along columns of the last axis; each lacks at most one run of cells. Each rank counts the columns, none
    makes more than its own particles.
    """

    def __init__(self, body: FilledShape, dimension: int) -> None:
        self.body, self.dimension = body, dimension
        shape = body.shape.model
        self.lower, self.upper, self.coarsest = body.extent()
        self.lines = lines_of(body)
        self.step = np.array([line.step for line in self.lines])
        self.volume = float(np.prod(self.step))
        self._count_columns(np.array(shape.centre, float), shape.radius)
        self.count = int(self.ends[-1])

    def _count_columns(self, centre: np.ndarray, radius: float) -> None:
        """The run of cells that each column lacks: where it starts, and its length; both 0 beside the hole."""
        self.cross_shape = tuple(line.count for line in self.lines[:-1])
        squared = np.zeros(self.cross_shape)
        for k, line in enumerate(self.lines[:-1]):
            distance = line.coordinate(np.arange(line.count)) - centre[k]
            squared += (distance**2).reshape([-1 if m == k else 1 for m in range(self.dimension - 1)])
        along = self.lines[-1]
        half = np.sqrt(np.maximum(radius**2 - squared.ravel(), 0.0))
        # centres lower + (i + 1/2) step that are closer to the hole's centre than `half`
        first = np.floor((centre[-1] - half - along.lower) / along.step - 0.5).astype(np.int64) + 1
        last = np.ceil((centre[-1] + half - along.lower) / along.step - 0.5).astype(np.int64)
        self.start, last = np.clip(first, 0, along.count), np.clip(last, 0, along.count)
        self.missing = np.where(half > 0.0, np.maximum(last - self.start, 0), 0)
        self.ends = np.cumsum(along.count - self.missing)

    def holds(self, index: list[np.ndarray]) -> np.ndarray:
        """Which lattice places carry a particle."""
        inside = np.ones(len(index[0]), bool)
        for i, line in zip(index, self.lines):
            inside &= (i >= 0) & (i < line.count)
        clipped = tuple(np.clip(i, 0, count - 1) for i, count in zip(index, self.cross_shape))
        column, along = np.ravel_multi_index(clipped, self.cross_shape), index[-1]
        return inside & ((along < self.start[column]) | (along >= self.start[column] + self.missing[column]))

    def piece(self, first: int, last: int) -> ParticleSet:
        identifier = np.arange(first, last)
        column = np.searchsorted(self.ends, identifier, side="right")
        along = identifier - self.ends[column] + self.lines[-1].count - self.missing[column]
        along += np.where(along >= self.start[column], self.missing[column], 0)
        index = [*np.unravel_index(column, self.cross_shape), along]
        return staircase(self, identifier, index, self.volume / self.step)
