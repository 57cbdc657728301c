"""Particles from meshes: any file that meshio reads with elements of the kinds in `elements.ELEMENTS`."""

import contextlib
import io
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.abaqus import read_abaqus
from parsolid.scene.bodies import FilledShape
from parsolid.scene.elements import ELEMENTS, OF_CORNERS, lumped_volumes, shares_of_nodes
from parsolid.scene.gmsh_text import read_gmsh_text
from parsolid.scene.lattice import jitter_offsets
from parsolid.scene.marks import TOLERANCE
from parsolid.scene.mesh_facets import boundary_facets, mean_edge, numbers_of_places, repeated_rows
from parsolid.scene.mesh_groups import MeshGroups, facets_in, groups_of, nodes_in
from parsolid.scene.mesh_inside import Solid
from parsolid.scene.named_regions import Region
from parsolid.scene.validation_errors import SceneError

_LESS_THAN_SOLID = {2: ("vertex", "line"), 3: ("vertex", "line", "triangle", "quad")}


class MeshOfFile(NamedTuple):
    """Node coordinates (nodes, d) [m], the blocks (kind, (elements, nodes)) of solid elements, named groups, and kinds
    of elements of second order, of which the corners are taken."""

    points: np.ndarray
    blocks: list[tuple[str, np.ndarray]]
    groups: MeshGroups
    of_second_order: tuple[str, ...]


def read_mesh(path: str, scale: float, dimension: int) -> MeshOfFile:
    """The mesh of a file, in the coordinates of a scene.

    Raises SceneError for a file that meshio cannot read and for elements that have no particles here.
    """
    # a scene without a mesh is spared its half second
    import meshio

    printed = io.StringIO()
    try:
        # some readers print, and meshio leaves the program when none fits
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            mesh = read_abaqus(path) if path.lower().endswith(".inp") else read_gmsh_text(path) or meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = " ".join(printed.getvalue().split()) or f"{type(error).__name__}: {error}"
        raise SceneError([f"expected a mesh that meshio reads, found {path} ({reason}{_remedy(path)})"]) from None
    mesh, of_second_order = _by_corners(mesh)
    known = [kind for kind, element in ELEMENTS.items() if element.dimension == dimension]
    kinds = [block.type for block in mesh.cells if len(block.data)]
    others = sorted(set(kinds) - set(known) - set(_LESS_THAN_SOLID[dimension]))
    if others:
        raise SceneError([f"expected only elements of the kinds {', '.join(known)}, found {', '.join(others)}"])
    blocks = [
        (block.type, np.asarray(block.data, np.int64))
        for block in mesh.cells
        if block.type in known and len(block.data)
    ]
    if not blocks:
        raise SceneError([f"expected elements of the kinds {', '.join(known)}, found {', '.join(kinds) or 'none'}"])
    _check_nodes(blocks, len(mesh.points))
    with np.errstate(over="ignore", invalid="ignore"):
        points = np.asarray(mesh.points, float) * scale
    if points.shape[1] < dimension or not np.isfinite(points).all():
        raise SceneError(
            [f"expected {dimension} finite coordinates a node, found {points.shape[1]} or some not finite"]
        )
    if points.shape[1] > dimension and not _is_plane(points, blocks):
        raise SceneError(["expected a plane mesh (one Z for all nodes) in 2-D, found nodes with different Z"])
    return MeshOfFile(np.ascontiguousarray(points[:, :dimension]), blocks, groups_of(mesh, dimension), of_second_order)


def _by_corners(mesh: Any) -> tuple[Any, tuple[str, ...]]:
    """A mesh of meshio whose elements of second order are those of their corners, and the kinds that there were."""
    found = tuple(dict.fromkeys(block.type for block in mesh.cells if block.type in OF_CORNERS and len(block.data)))
    if found:
        cells = []
        for block in mesh.cells:
            kind, count = OF_CORNERS.get(block.type, (block.type, None))
            cells.append(type(block)(kind, np.asarray(block.data)[:, :count]))
        mesh.cells = cells
    return mesh, found


def _is_plane(points: np.ndarray, blocks: list[tuple[str, np.ndarray]]) -> bool:
    """Whether the nodes of elements have one Z, but for the rounding of the program that wrote them."""
    used = points[np.unique(np.concatenate([cells.ravel() for _, cells in blocks]))]
    shortest = min(
        float(np.linalg.norm(points[cells[:, 0]] - points[cells[:, 1]], axis=1).min()) for _, cells in blocks
    )
    return bool(np.ptp(used[:, 2:]) <= TOLERANCE * shortest)


def _remedy(path: str) -> str:
    """What to do about the Gmsh files that meshio does not read; empty for others."""
    if not path.lower().endswith(".msh"):
        return ""
    with open(path, "rb") as file:
        text = file.read()
    if b"$ParametricNodes" in text:
        return "; Gmsh writes plain nodes with Mesh.SaveParametric = 0"
    return "; where only some elements are in a physical group, Gmsh writes those alone with Mesh.SaveAll = 0"


def _check_nodes(blocks: list[tuple[str, np.ndarray]], count: int) -> None:
    """Raise SceneError unless elements name nodes that there are."""
    for kind, cells in blocks:
        wrong = cells[(cells < 0) | (cells >= count)]
        if len(wrong):
            raise SceneError([f"expected nodes from 0 to {count - 1} in every element, found {wrong[0]} in a {kind}"])


def _check_repeated(points: np.ndarray, blocks: list[tuple[str, np.ndarray]]) -> None:
    """Raise SceneError when an element is there twice, on the same nodes or on others at the same places."""
    place = numbers_of_places(points)
    for kind in dict.fromkeys(kind for kind, _ in blocks):
        cells = np.concatenate([own for other, own in blocks if other == kind])
        repeated, first = repeated_rows(np.sort(place[cells], axis=1))
        if repeated:
            middle = ", ".join(f"{x:g}" for x in points[cells[first]].mean(axis=0))
            found = f"{repeated} {kind} elements more than once, the first at ({middle})"
            raise SceneError([f"expected every element once, found {found}"])


def used_nodes(points: np.ndarray, blocks: list[tuple[str, np.ndarray]]) -> np.ndarray:
    """Numbers (k,), rising, of the nodes of elements: those that are particles, in this order."""
    met = np.zeros(len(points), bool)
    for _, cells in blocks:
        met[cells] = True
    return np.flatnonzero(met)


class MeshFilling:
    """Particles of a mesh, on its nodes or at the centroids of its elements.

    nodes: volumes of the elements and areas of the boundary facets lumped to their nodes, the spacing is the mean
    length of the edges that meet; nodes of no element are dropped. cells: one particle an element, the spacing is its
    volume to the power 1/d. Raises SceneError for meshes that cannot be read and for elements that are partly inside
    out.
    """

    def __init__(self, body: FilledShape, dimension: int) -> None:
        self.body = body
        points, blocks, self.groups, _ = read_mesh(body.shape.model.file, body.shape.model.scale, dimension)
        lumped = [self._sound_volumes(kind, points[cells]) for kind, cells in blocks]
        _check_repeated(points, blocks)
        used = used_nodes(points, blocks)
        self.lower, self.upper = points[used].min(axis=0), points[used].max(axis=0)
        facets, edge = boundary_facets(points, blocks), mean_edge(points, blocks)
        self.solid = Solid(points, blocks, facets)
        self._check_apart()
        if body.placed_on == "nodes":
            self._on_nodes(points, blocks, lumped, facets, used)
            self.spacing = edge[used]
        else:
            self._in_cells(points, blocks, lumped, facets)
        self.regions: np.ndarray | None = None
        self.surfaces: np.ndarray | None = None
        self._whole = points, blocks, facets, used, TOLERANCE * edge
        self.count = len(self.volume)
        self.coarsest = float(self.spacing.max())

    def _check_apart(self) -> None:
        count, place = self.solid.within_itself()
        if place is not None:
            found = (
                f"{count} facets of its surface in other elements, the first at ({', '.join(f'{x:g}' for x in place)})"
            )
            raise SceneError([f"expected a mesh that does not lie in itself, found {found}"])

    @staticmethod
    def _sound_volumes(kind: str, nodes: np.ndarray) -> np.ndarray:
        volumes, sound = lumped_volumes(kind, nodes)
        if not sound.all():
            bad = np.flatnonzero(~sound)
            place = ", ".join(f"{x:g}" for x in nodes[bad[0]].mean(axis=0))
            found = f"{len(bad)} {kind} elements inside out or flat, the first at ({place})"
            raise SceneError([f"expected elements of positive volume, found {found}"])
        return volumes

    def _on_nodes(
        self, points: np.ndarray, blocks: Any, lumped: list[np.ndarray], facets: Any, used: np.ndarray
    ) -> None:
        total = len(points)
        volume = np.zeros(total)
        for (_, cells), shares in zip(blocks, lumped):
            volume += np.bincount(cells.ravel(), shares.ravel(), minlength=total)
        area = np.zeros_like(points)
        for _, nodes, vectors in facets:
            shares = shares_of_nodes(points[nodes], vectors)
            for i in range(points.shape[1]):
                area[:, i] += np.bincount(nodes.ravel(), shares[:, :, i].ravel(), minlength=total)
        self.position, self.volume, self.area = points[used], volume[used], area[used]
        self.movable = np.ones(total, bool)
        for _, nodes, _ in facets:
            self.movable[nodes] = False
        self.movable = self.movable[used]

    def _in_cells(self, points: np.ndarray, blocks: Any, lumped: list[np.ndarray], facets: Any) -> None:
        self.position = np.concatenate([points[cells].mean(axis=1) for _, cells in blocks])
        self.volume = np.concatenate([shares.sum(axis=1) for shares in lumped])
        self.area = np.zeros_like(self.position)
        for owner, _, vectors in facets:
            np.add.at(self.area, owner, vectors)
        self.movable = np.ones(len(self.volume), bool)
        self.spacing = self.volume ** (1.0 / points.shape[1])

    def mark(self, known: Mapping[str, Region]) -> None:
        """Find the particles in regions, and what of their surface is: facets of which all nodes are."""
        points, blocks, facets, used, tolerance = self._whole
        cells, on_nodes = [nodes for _, nodes in blocks], self.body.placed_on == "nodes"
        vectors = np.zeros((len(points) if on_nodes else self.count, len(known), points.shape[1]))
        for owner, nodes, area in facets:
            inside = facets_in(known, self.groups, points, tolerance, cells, nodes)
            shares = shares_of_nodes(points[nodes], area).swapaxes(0, 1) if on_nodes else [area]
            for to, share in zip(nodes.T if on_nodes else [owner], shares):
                np.add.at(vectors, to, inside[:, :, None] * share[:, None, :])
        if on_nodes:
            held, vectors = nodes_in(known, self.groups, points, tolerance, cells)[used], vectors[used]
        else:
            held = self._elements_in(known)
        self.regions = (held | vectors.any(axis=2)).astype(np.int64)
        self.surfaces = vectors.reshape(self.count, -1)

    def _elements_in(self, known: Mapping[str, Region]) -> np.ndarray:
        def of_group(name: str) -> np.ndarray:
            return np.isin(np.arange(self.count), self.groups.elements.get(name, ()))

        tolerance = TOLERANCE * self.spacing
        return np.stack([one.contains(self.position, tolerance, known, of_group) for one in known.values()], axis=1)

    def piece(self, first: int, last: int) -> ParticleSet:
        identifier = np.arange(first, last)
        rows = slice(first, last)
        dimension = self.position.shape[1]
        spacing = np.repeat(self.spacing[rows, None], dimension, axis=1)
        offset = jitter_offsets(self.body, identifier, self.movable[rows], dimension)
        return ParticleSet(
            identifier=identifier,
            position=self.position[rows] + offset * spacing,
            volume=self.volume[rows].copy(),
            spacing=spacing,
            axes=None,
            body=np.zeros(len(identifier), np.int32),
            area=self.area[rows].copy(),
            regions=None if self.regions is None else self.regions[rows].copy(),
            surfaces=None if self.surfaces is None else self.surfaces[rows].copy(),
        )
