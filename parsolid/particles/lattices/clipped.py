"""Cylinders, spheres and discs: a Cartesian lattice of cells of which those with their centre inside are kept."""

import math

import numpy as np

from parsolid.particles.lattices.lattice import lines_of, staircase
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.bodies import FilledShape


class ClippedFilling:
    """A solid cylinder, sphere or disc of lattice cells, the lattice centred on the shape.

    All cells have the same volume, scaled so that they sum to the exact volume of the shape; boundary areas are the
    faces of the staircase, scaled alike (the ends of a cylinder sum to their exact area). Ids run along columns: the
    axis of a cylinder, the last axis of a sphere or disc. Each rank counts the columns, none makes more than its own
    particles.
    """

    def __init__(self, body: FilledShape, dimension: int) -> None:
        self.body = body
        self.dimension = dimension
        shape = body.shape.model
        radius = shape.radius
        self.halved = []
        self.lower, self.upper, self.coarsest = body.extent()
        if body.shape.kind == "sphere":
            self.column_axis = dimension - 1
            exact = math.pi * radius**2 if dimension == 2 else 4.0 / 3.0 * math.pi * radius**3
            curved = dimension
        else:
            self.column_axis = "XYZ".index(shape.axis)
            curved = 2
            # planes of symmetry through the axis start the lattice there
            self.halved = shape.halved
            exact = math.pi * radius**2 * shape.length / 2 ** len(self.halved)
        self.lines = lines_of(body)
        self.step = np.array([line.step for line in self.lines])
        self.across = [i for i in range(dimension) if i != self.column_axis]
        self._count_columns(radius, body.shape.kind == "sphere")
        self.count = int(self.ends[-1])
        self.volume = exact / max(self.count, 1)
        # area of a cell's face by its normal, after the dilation in the curved directions that makes the volume exact
        dilation = (self.volume / np.prod(self.step)) ** (1.0 / curved)
        straight = (np.arange(dimension) == self.column_axis) & (curved < dimension)
        sides = self.step * np.where(straight, 1.0, dilation)
        self.face = np.prod(sides) / sides

    def _count_columns(self, radius: float, sphere: bool) -> None:
        """Particles in each column: the lattice is symmetric, so a column is given by its length."""
        self.cross_shape = tuple(self.lines[i].count for i in self.across)
        squared = np.zeros(self.cross_shape)
        for k, i in enumerate(self.across):
            line = self.lines[i]
            middle = -0.5 if i in self.halved else 0.5 * (line.count - 1)
            distance = (np.arange(line.count) - middle) * line.step
            squared += (distance**2).reshape([-1 if m == k else 1 for m in range(len(self.across))])
        inside = squared.ravel() < radius**2
        whole = self.lines[self.column_axis].count
        if sphere:
            reach = np.sqrt(np.where(inside, radius**2 - squared.ravel(), 0.0)) / self.step[self.column_axis]
            even = 2 * np.floor(reach + 0.5).astype(np.int64)
            odd = 2 * np.floor(reach).astype(np.int64) + 1
            length = np.minimum(whole, odd if whole % 2 else even)
        else:
            length = np.full(len(inside), whole)
        self.length = np.where(inside, length, 0)
        self.ends = np.cumsum(self.length)

    def holds(self, index: list[np.ndarray]) -> np.ndarray:
        """Which lattice places carry a particle."""
        cross = [index[i] for i in self.across]
        inside = np.ones(len(cross[0]), bool)
        for i, count in zip(cross, self.cross_shape):
            inside &= (i >= 0) & (i < count)
        clipped = tuple(np.clip(i, 0, count - 1) for i, count in zip(cross, self.cross_shape))
        length = self.length[np.ravel_multi_index(clipped, self.cross_shape)]
        start = (self.lines[self.column_axis].count - length) // 2
        along = index[self.column_axis]
        return inside & (along >= start) & (along < start + length)

    def piece(self, first: int, last: int) -> ParticleSet:
        identifier = np.arange(first, last)
        column = np.searchsorted(self.ends, identifier, side="right")
        length = self.length[column]
        along = (self.lines[self.column_axis].count - length) // 2 + identifier - (self.ends[column] - length)
        index = [along] * self.dimension
        for i, cross in zip(self.across, np.unravel_index(column, self.cross_shape)):
            index[i] = cross
        return staircase(self, identifier, index, self.face)
