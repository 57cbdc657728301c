"""Lattices that fill shapes: a new shape is a model in `scene.shapes` and a class here."""

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.particles.lattice import BoxFilling, Filling, Lattice, Line, jitter_offsets, lattice_with_faces, lines_of
from parsolid.particles.meshes.filling import MeshFilling
from parsolid.particles.meshes.slices import MeshSlices
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.bodies import Extent, FilledShape


class PerforatedFilling:
    """A box with a round hole, whose surface is a staircase.

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
        """Start and length of the run of cells that each column lacks; both 0 beside the hole."""
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
        return lattice_with_faces(self, identifier, index, self.volume / self.step)


class ShellFilling(Lattice):
    """A cylindrical shell on the lattice (hoop, axial, radial), a ring on (hoop, radial); ids run fastest radially.

    The particle's own axes are its hoop, axial and radial direction. Volumes are r dr dtheta dz with the trapezoid rule
    on nodes, the midpoint rule on cells: both sum to the exact volume. A closed ring has no particle twice.
    """

    def __init__(self, body: FilledShape, dimension: int) -> None:
        shape = body.shape.model
        self.body = body
        self.dimension = dimension
        self.axis, self.origin = shape.normal, np.array(shape.origin, float)
        nodes = body.placed_on == "vertices"
        inner, outer = shape.radius - 0.5 * shape.thickness, shape.radius + 0.5 * shape.thickness
        start, end = np.radians(shape.angles)
        numbers = body.numbers()
        lines = [Line(start, end, numbers[0], nodes, shape.closed)]
        if dimension == 3:
            lines.append(Line(0.0, shape.length, numbers[1], nodes))
        super().__init__([*lines, Line(inner, outer, numbers[-1], nodes)])
        self.lower, self.upper, self.coarsest = body.extent()

    def _axes(self, cosine: np.ndarray, sine: np.ndarray) -> np.ndarray:
        axes = np.zeros((len(cosine), self.dimension, self.dimension))
        b, c = (self.axis + 1) % 3, (self.axis + 2) % 3
        axes[:, 0, b], axes[:, 0, c] = -sine, cosine
        axes[:, -1, b], axes[:, -1, c] = cosine, sine
        if self.dimension == 3:
            axes[:, 1, self.axis] = 1.0
        return axes

    def piece(self, first: int, last: int) -> ParticleSet:
        identifier = np.arange(first, last)
        index = self.indices(first, last)
        offset = jitter_offsets(self.body, identifier, self.movable(index), len(self.lines))
        coordinates = [line.coordinate(i, offset[:, k]) for k, (line, i) in enumerate(zip(self.lines, index))]
        weight = [line.weight(i) for line, i in zip(self.lines, index)]
        side = np.stack([line.side(i) for line, i in zip(self.lines, index)], axis=1)
        # volumes and areas are those of the lattice before it was jittered
        radius = self.lines[-1].coordinate(index[-1])
        axial_weight = weight[1] if self.dimension == 3 else np.ones(len(identifier))
        arc = weight[0] * radius
        face_radius = radius if self.lines[-1].nodes else radius + 0.5 * side[:, -1] * weight[-1]
        faces = [weight[-1] * axial_weight, arc * weight[-1], weight[0] * face_radius * axial_weight]
        face = np.stack(faces if self.dimension == 3 else [faces[0], faces[2]], axis=1)
        steps = [radius * self.lines[0].step] + [np.full(len(identifier), line.step) for line in self.lines[1:]]
        angle = coordinates[0]
        cosine, sine = np.cos(angle), np.sin(angle)
        # exactly zero where they vanish, so that particles lie on the planes of symmetry
        for values in (cosine, sine):
            values[np.abs(values) < 1e-15] = 0.0
        axes = self._axes(cosine, sine)
        radius = coordinates[-1]
        position = np.empty((len(cosine), self.dimension))
        position[:, (self.axis + 1) % 3] = radius * cosine
        position[:, (self.axis + 2) % 3] = radius * sine
        if self.dimension == 3:
            position[:, self.axis] = coordinates[1]
        return ParticleSet(
            identifier=identifier,
            position=position + self.origin,
            volume=arc * weight[-1] * axial_weight,
            spacing=np.stack(steps, axis=1),
            axes=axes,
            body=np.zeros(len(identifier), np.int32),
            area=np.einsum("nk,nkd->nd", side * face, axes),
        )


class PerforatedNodes:
    """A box with a round hole, with particles on the nodes of the cells of `PerforatedFilling`.

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
        """Start and length of the run of nodes that each column lacks: those without a cell around them."""
        cells, last = self.cells, self.cells.lines[-1].count
        # columns beside the box lack all cells
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
        return lattice_with_faces(self, identifier, index, self.face)


_FILLINGS: dict[str, Any] = {
    "box": BoxFilling,
    "perforated_box": PerforatedFilling,
    "cylindrical_shell": ShellFilling,
    "cylinder": ClippedFilling,
    "sphere": ClippedFilling,
}


def filling_of(
    body: FilledShape,
    dimension: int,
    comm: MPI.Comm = MPI.COMM_SELF,
    mesh: MeshSlices | None = None,
    groups: Sequence[str] = (),
    by_nodes: bool = False,
) -> Filling:
    """The particles of a body, not yet made; mesh, groups, by_nodes: see `MeshFilling`; collective. Raises SceneError
    for a mesh that cannot be used."""
    if body.shape.kind != "mesh":
        nodes_of_cells = body.shape.kind == "perforated_box" and body.placed_on == "vertices"
        made: Filling = (PerforatedNodes if nodes_of_cells else _FILLINGS[body.shape.kind])(body, dimension)
        return made
    filling = MeshFilling(comm, body, dimension, mesh, groups, by_nodes)
    _EXTENTS[_key(body, dimension)] = Extent(filling.lower, filling.upper, filling.coarsest)
    return filling


# extents of meshes that have been read
_EXTENTS: dict[tuple[Any, ...], Extent] = {}


def extent_of(body: FilledShape, dimension: int) -> Extent:
    """The extent of a body. Raises SceneError for a mesh that cannot be used."""
    if body.shape.kind != "mesh":
        return body.extent()
    if _key(body, dimension) not in _EXTENTS:
        filling_of(body, dimension)
    return _EXTENTS[_key(body, dimension)]


def _key(body: FilledShape, dimension: int) -> tuple[Any, ...]:
    """Key of the extent of a mesh."""
    model, state = body.shape.model, os.stat(body.shape.model.file)
    return *model.mesh_key, model.group, body.placed_on, dimension, state.st_mtime_ns, state.st_size
