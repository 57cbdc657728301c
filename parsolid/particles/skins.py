"""The surface that particles stand for: faces between them where their lattice or mesh is known."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from parsolid.particles.fillings import filling_of
from parsolid.particles.lattice import Lattice
from parsolid.particles.meshes.elements import ELEMENTS
from parsolid.particles.meshes.imported import read_mesh
from parsolid.scene.validation_errors import SceneError


@dataclass(frozen=True)
class Skin:
    """The faces of one body; its particles are rows first .. last-1.

    patches: smooth pieces, each faces (m, 3 or 4) of point numbers counted within the body; None: no faces are known,
    the particles are drawn one by one. shape: the lattice whose points are extrapolated from cells, None where
    particles are themselves the points; lines: number of points and closedness along each direction of a lattice;
    elements: kind and point numbers (m, k) of the elements of a mesh in space.
    """

    first: int
    last: int
    patches: list[np.ndarray] | None
    cells: tuple[tuple[int, bool], ...] | None = None
    lines: tuple[tuple[int, bool], ...] | None = None
    elements: tuple[tuple[str, np.ndarray], ...] | None = None

    @property
    def solid(self) -> bool:
        """Whether what is between the particles is known, so that a cut through it can be drawn."""
        return self.lines is not None or self.elements is not None

    @property
    def reaches(self) -> bool:
        """Whether what is drawn reaches beyond the particles' positions."""
        return self.patches is None or self.cells is not None

    def moved(self, rows: int) -> "Skin":
        """The same skin of particles that come so many rows later."""
        return replace(self, first=self.first + rows, last=self.last + rows)

    def by_particle(self) -> "Skin":
        """The same body drawn particle by particle."""
        return replace(self, patches=None, cells=None, lines=None, elements=None)

    def points(self, values: np.ndarray, linear: bool) -> np.ndarray:
        """Values (n, ...) of the body's particles at the points of the faces.

        linear: continue linearly to the surface (positions) rather than constantly (fields, whose range must not grow).
        """
        if self.cells is None:
            return values
        grid = values.reshape(*(count for count, _ in self.cells), *values.shape[1:])
        for axis, (count, closed) in enumerate(self.cells):
            grid = _to_corners(grid, axis, closed, linear) if count > 1 else grid
        return grid.reshape(-1, *values.shape[1:])


def _to_corners(grid: np.ndarray, axis: int, closed: bool, linear: bool) -> np.ndarray:
    """From the middle of cells to their ends along an axis."""
    grid = np.moveaxis(grid, axis, 0)
    if closed:
        ends = 0.5 * (grid + np.roll(grid, 1, axis=0))
    else:
        inner = 0.5 * (grid[1:] + grid[:-1])
        reach = 0.5 if linear else 0.0
        lower, upper = grid[0] + reach * (grid[0] - grid[1]), grid[-1] + reach * (grid[-1] - grid[-2])
        ends = np.concatenate([lower[None], inner, upper[None]])
    return np.moveaxis(ends, 0, axis)


def skins_of(bodies: Mapping[int, Any], dimension: int, body: np.ndarray) -> list[Skin]:
    """The skin of every body of a scene.

    bodies: place -> `FilledShape`, those that could be read; body (n,): the body of each particle, in the order of
    identifiers, body by body, in a scene of several methods first those of the first method.
    """
    skins = []
    ends = np.flatnonzero(np.diff(body, prepend=-1, append=-1)).tolist()
    for first, last in pairwise(ends):
        place = int(body[first])
        known: tuple[Any, ...] = (None, None, None, None)
        if place in bodies:
            # a mesh that has gone since the run is drawn particle by particle
            with suppress(SceneError):
                known = _patches(bodies[place], dimension, last - first)
        skins.append(Skin(first, last, *known))
    return skins


def _of_group(blocks: list[tuple[str, np.ndarray]], elements: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """The elements of some numbers, which count over all blocks."""
    result, first = [], 0
    for kind, cells in blocks:
        own = elements[(elements >= first) & (elements < first + len(cells))] - first
        result.append((kind, cells[own]))
        first += len(cells)
    return [one for one in result if len(one[1])]


def _patches(filled: Any, dimension: int, count: int) -> tuple[list[np.ndarray] | None, Any, Any, Any]:
    """Faces, cells, lines and elements of a `Skin`."""
    if filled.shape.kind == "mesh":
        if filled.placed_on == "cells":
            return None, None, None, None
        mesh = filled.shape.model
        points, blocks, groups, _ = read_mesh(mesh.file, dimension, mesh)
        if mesh.group is not None:
            blocks = _of_group(blocks, groups.elements.get(mesh.group, np.zeros(0, np.int64)))
        used = np.unique(np.concatenate([cells.ravel() for _, cells in blocks]))
        number = np.zeros(len(points), np.int64)
        number[used] = np.arange(len(used))
        if len(used) != count:
            return None, None, None, None
        blocks = [(kind, number[cells]) for kind, cells in blocks]
        if dimension == 2:
            return [cells for _, cells in blocks], None, None, None
        return _outer_facets(blocks), None, None, tuple(blocks)
    filling = filling_of(filled, dimension)
    if not isinstance(filling, Lattice) or filling.count != count:
        return None, None, None, None
    lines = [(line.count, line.closed) for line in filling.lines]
    cells = None
    if filled.placed_on == "cells":
        cells = tuple(lines)
        lines = [(count + (count > 1 and not closed), closed) for count, closed in lines]
    faces = lattice_faces(lines, dimension)
    return (faces, cells, tuple(lines), None) if faces else (None, None, None, None)


def lattice_faces(lines: list[tuple[int, bool]], dimension: int) -> list[np.ndarray]:
    """Patches of quads (m, 4) on the surface of a lattice (its whole area in the plane); none for a line of particles.

    lines: (number of points, closed) along each direction; point numbers run fastest along the last.
    """
    number = np.arange(int(np.prod([count for count, _ in lines]))).reshape([count for count, _ in lines])
    if dimension == 2:
        sides = [(number, lines)]
    else:
        sides = []
        for axis, (count, closed) in enumerate(lines):
            rest = [line for i, line in enumerate(lines) if i != axis]
            if not closed:
                # the two sides of a single layer are one
                sides += [(np.take(number, end, axis), rest) for end in ((0,) if count == 1 else (0, count - 1))]
    return [_quads(grid, rest) for grid, rest in sides if min(grid.shape) > 1]


def _quads(grid: np.ndarray, lines: list[tuple[int, bool]]) -> np.ndarray:
    for axis, (_, closed) in enumerate(lines):
        if closed:
            grid = np.concatenate([grid, np.take(grid, [0], axis)], axis=axis)
    corners = (grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:])
    return np.stack([corner.ravel() for corner in corners], axis=1)


def _outer_facets(blocks: list[tuple[str, np.ndarray]]) -> list[np.ndarray]:
    """Facets that belong to one element only, by number of nodes."""
    gathered: dict[Any, Any] = {}
    for kind, cells in blocks:
        for facet in ELEMENTS[kind].facets:
            gathered.setdefault(len(facet), []).append(cells[:, facet])
    result = []
    for pieces in gathered.values():
        facets = np.concatenate(pieces)
        _, index, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
        result.append(facets[np.sort(index[count == 1])])
    return result
