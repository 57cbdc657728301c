"""Box lattices, made piece by piece: any range of ids without the rest of the lattice."""

import math
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.bodies import FilledShape, graded_shares


class Filling(Protocol):
    """Particles that fill a body, addressed by their id within the body, 0 .. count-1.

    lower, upper (d,) bound the body itself; coarsest is its largest particle spacing [m].
    """

    count: int
    lower: np.ndarray
    upper: np.ndarray
    coarsest: float

    def piece(self, first: int, last: int) -> ParticleSet:
        """The particles with ids first .. last-1, their body index left at 0."""


@dataclass(frozen=True)
class Line:
    """Particles along one direction of a lattice from `lower` to `upper`; a closed line joins its end to its start.

    grading: of nodes, see `bodies.graded_shares`; even steps where there is none.
    """

    lower: float
    upper: float
    count: int
    nodes: bool
    closed: bool = False
    grading: tuple[float, ...] = ()

    @property
    def _on_ends(self) -> bool:
        return self.nodes and not self.closed and self.count > 1

    @property
    def step(self) -> float:
        """Distance of neighbours, their mean where it is graded; the whole length for a lone particle."""
        return (self.upper - self.lower) / (self.count - 1 if self._on_ends else self.count)

    def coordinate(self, index: np.ndarray, offset: np.ndarray | float = 0.0) -> np.ndarray:
        """Coordinates at indices moved by `offset` steps; both ends are met exactly by nodes."""
        if self._on_ends:
            share = (index + offset) / (self.count - 1)
        else:
            share = (index + offset + (0.0 if self.closed and self.nodes else 0.5)) / self.count
        return (1.0 - share) * self.lower + share * self.upper

    @property
    def shares(self) -> np.ndarray | None:
        """Places (count,) of the nodes between 0 and 1, None where steps are even."""
        return graded_shares(self.count, self.grading) if self.grading else None

    def place(self, index: np.ndarray) -> np.ndarray:
        """Coordinates of the particles at indices."""
        if self.shares is None:
            return self.coordinate(index)
        share = self.shares[index]
        return (1.0 - share) * self.lower + share * self.upper

    def weight(self, index: np.ndarray) -> np.ndarray:
        """Tributary length at indices: half a step at the ends of nodes."""
        if self.shares is not None:
            halves = 0.5 * (self.upper - self.lower) * np.pad(np.diff(self.shares), 1)
            return np.asarray((halves[1:] + halves[:-1])[index])
        if not self._on_ends:
            return np.full(len(index), self.step)
        return np.where((index == 0) | (index == self.count - 1), 0.5 * self.step, self.step)

    def side(self, index: np.ndarray) -> np.ndarray:
        """-1 at the lower end, +1 at the upper, 0 between; 0 for a lone particle, whose two ends cancel."""
        if self.closed or self.count == 1:
            return np.zeros(len(index))
        return (index == self.count - 1).astype(float) - (index == 0)


def _hashed(values: np.ndarray) -> np.ndarray:
    """splitmix64: a well-mixed 64-bit hash of each value."""
    z = values.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


def jitter_offsets(body: FilledShape, identifier: np.ndarray, movable: np.ndarray, directions: int) -> np.ndarray:
    """Random offsets (n, directions) in steps, uniform within the body's jitter, a function of seed and id alone."""
    if body.jitter == 0.0:
        return np.zeros((len(identifier), directions))
    stream = _hashed(identifier.astype(np.uint64) ^ _hashed(np.array([body.seed], np.uint64)))
    uniform = [_hashed(stream + np.uint64(i)) / 2.0**64 for i in range(directions)]
    return body.jitter * (2.0 * np.stack(uniform, axis=1) - 1.0) * movable[:, None]


def lines_of(body: FilledShape) -> list[Line]:
    """The lines of a lattice within the bounds of a body's shape."""
    nodes, (lower, upper) = body.placed_on == "vertices", body.shape.model.bounds()
    return [Line(low, high, count, nodes) for low, high, count in zip(lower, upper, body.numbers())]


def lattice_with_faces(filling: Any, identifier: np.ndarray, index: list[np.ndarray], face: np.ndarray) -> ParticleSet:
    """Particles at places of a lattice of which a filling holds some, with a face towards each neighbour that it lacks.

    filling: has `holds`; index: d arrays (n,); face (d,) [m^2]: area of a particle's face across each axis.
    """
    count, dimension = len(identifier), len(index)
    area = np.zeros((count, dimension))
    for i in range(dimension):
        for side in (-1, 1):
            beyond = [one + side if k == i else one for k, one in enumerate(index)]
            area[:, i] += side * face[i] * ~filling.holds(beyond)
    offset = jitter_offsets(filling.body, identifier, np.ones(count, bool), dimension)
    coordinates = [line.coordinate(one, offset[:, k]) for k, (line, one) in enumerate(zip(filling.lines, index))]
    return ParticleSet(
        identifier=identifier,
        position=np.stack(coordinates, axis=1),
        volume=np.full(count, filling.volume),
        spacing=np.tile(filling.step, (count, 1)),
        axes=None,
        body=np.zeros(count, np.int32),
        area=area,
    )


class Lattice:
    """The product of lines; ids run fastest along the last."""

    def __init__(self, lines: list[Line]) -> None:
        self.lines = lines
        self.shape = tuple(line.count for line in lines)
        self.count = math.prod(self.shape)

    def indices(self, first: int, last: int) -> list[np.ndarray]:
        """Index along each line of the particles first .. last-1."""
        return list(np.unravel_index(np.arange(first, last), self.shape))

    def movable(self, index: list[np.ndarray]) -> np.ndarray:
        """Which particles jitter may move: all in cells, those off the ends among nodes."""
        result = np.ones(len(index[0]), bool)
        for line, i in zip(self.lines, index):
            if line.nodes:
                result &= line.side(i) == 0.0
        return result


class BoxFilling(Lattice):
    """A box filled with nodes (trapezoid volumes) or cells; ids run fastest along the last axis."""

    def __init__(self, body: FilledShape, dimension: int) -> None:
        super().__init__(lines_of(body))
        self.body = body
        grading = getattr(body, "grading", None)
        if grading is not None:
            graded = [tuple(one) if len(one) > 1 else () for one in grading]
            self.lines = [replace(line, grading=one) for line, one in zip(self.lines, graded)]
        self.lower, self.upper, self.coarsest = body.extent()

    def piece(self, first: int, last: int) -> ParticleSet:
        identifier = np.arange(first, last)
        index = self.indices(first, last)
        offset = jitter_offsets(self.body, identifier, self.movable(index), len(self.lines))
        weight = np.stack([line.weight(i) for line, i in zip(self.lines, index)], axis=1)
        volume = np.prod(weight, axis=1)
        side = np.stack([line.side(i) for line, i in zip(self.lines, index)], axis=1)
        # graded lines have no jitter
        coordinates = [
            line.place(i) if line.grading else line.coordinate(i, offset[:, k])
            for k, (line, i) in enumerate(zip(self.lines, index))
        ]
        return ParticleSet(
            identifier=identifier,
            position=np.stack(coordinates, axis=1),
            volume=volume,
            spacing=np.tile([line.step for line in self.lines], (len(identifier), 1)),
            axes=None,
            body=np.zeros(len(identifier), np.int32),
            area=side * volume[:, None] / weight,
        )

    def nodes(self, identifier: np.ndarray) -> list[np.ndarray]:
        """Index along each line of particles (n,) by their ids."""
        return list(np.unravel_index(identifier, self.shape))

    def holds_cells(self, index: list[np.ndarray]) -> np.ndarray:
        """Which cells between nodes, by the index of their lower node, are in the box."""
        inside = [(i >= 0) & (i < count - 1) for i, count in zip(index, self.shape)]
        return np.logical_and.reduce(inside)
