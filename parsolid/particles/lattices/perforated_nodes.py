"""Boxes with a hole whose particles are the corners of the kept cells of `perforated`."""

import numpy as np

from parsolid.particles.lattices.lattice import jitter_offsets, lines_of
from parsolid.particles.lattices.perforated import PerforatedFilling
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.bodies import FilledShape


class PerforatedNodes:
    """A node is there when any cell around it is; its volume and faces are its parts of theirs.

    Ids run along columns of the last axis; each lacks at most one run of nodes.
    """

    def __init__(self, body: FilledShape, dimension: int) -> None:
        self.body, self.dimension = body, dimension
        self.lines = lines_of(body)
        between = [line.count - 1 for line in self.lines]
        cells = body.model_copy(update={"particles": between, "spacing": None, "placement": "cells"})
        self.cells = PerforatedFilling(cells, dimension)
        self.lower, self.upper, self.coarsest = self.cells.lower, self.cells.upper, self.cells.coarsest
        self._count_columns()
        self.count = int(self.ends[-1])

    def _count_columns(self) -> None:
        """The run of nodes that each column lacks, which is inside what all cell columns around it lack."""
        cells, last = self.cells, self.cells.lines[-1].count
        # what is beside the box lacks every cell
        start = np.pad(cells.start.reshape(cells.cross_shape), 1)
        end = np.pad((cells.start + cells.missing).reshape(cells.cross_shape), 1, constant_values=last)
        for axis in range(self.dimension - 1):
            lower, upper = _pairs(start, axis)
            start = np.maximum(lower, upper)
            lower, upper = _pairs(end, axis)
            end = np.minimum(lower, upper)
        self.cross_shape = start.shape
        # a node at the end of the missing run is a corner of the cell beyond, where there is one
        first = np.where(start == 0, 0, start + 1).ravel()
        after = np.where(end == last, last + 1, end).ravel()
        self.missing = np.where(end.ravel() > start.ravel(), np.maximum(after - first, 0), 0)
        self.start = np.where(self.missing > 0, first, 0)
        self.ends = np.cumsum(last + 1 - self.missing)

    def holds_cells(self, index: list[np.ndarray]) -> np.ndarray:
        """Which cells, by the index of their lower node, are in the body."""
        return self.cells.holds(index)

    def nodes(self, identifier: np.ndarray) -> list[np.ndarray]:
        """Index along each line of particles (n,) by their ids."""
        column = np.searchsorted(self.ends, identifier, side="right")
        count = self.cells.lines[-1].count + 1
        along = identifier - self.ends[column] + count - self.missing[column]
        along += np.where(along >= self.start[column], self.missing[column], 0)
        return [*np.unravel_index(column, self.cross_shape), along]

    def piece(self, first: int, last: int) -> ParticleSet:
        identifier = np.arange(first, last)
        index, d = self.nodes(identifier), self.dimension
        count, face = len(identifier), self.cells.volume / self.cells.step
        corners, area = np.zeros(count), np.zeros((count, d))
        for side in np.ndindex(*(2,) * d):
            here = self.holds_cells([i - s for i, s in zip(index, side)])
            corners += here
            area += np.outer(here, (2.0 * np.array(side) - 1.0) * face / 2 ** (d - 1))
        movable = corners == 2**d
        offset = jitter_offsets(self.body, identifier, movable, d)
        coordinates = [line.coordinate(i, offset[:, k]) for k, (line, i) in enumerate(zip(self.lines, index))]
        return ParticleSet(
            identifier=identifier,
            position=np.stack(coordinates, axis=1),
            volume=corners * self.cells.volume / 2**d,
            spacing=np.tile(self.cells.step, (count, 1)),
            axes=None,
            body=np.zeros(count, np.int32),
            area=area,
        )


def _pairs(columns: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Neighbours along an axis, the lower and the upper ones."""
    count = columns.shape[axis]
    return columns.take(range(count - 1), axis), columns.take(range(1, count), axis)
