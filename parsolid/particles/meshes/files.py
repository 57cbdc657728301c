"""Mesh files: any that meshio reads with elements of the kinds in `elements.ELEMENTS`, and imported ones."""

import contextlib
import io
import os
from typing import Any, NamedTuple

import numpy as np

from parsolid.particles.marks import TOLERANCE
from parsolid.particles.meshes.abaqus import read_abaqus
from parsolid.particles.meshes.elements import ELEMENTS, OF_CORNERS
from parsolid.particles.meshes.geometry import is_geometry, meshed
from parsolid.particles.meshes.gmsh_text import complete_groups, read_gmsh_text
from parsolid.particles.meshes.groups import MeshGroups, groups_of
from parsolid.particles.meshes.remeshed import remeshed
from parsolid.scene.shapes import BodyMesh
from parsolid.scene.validation_errors import SceneError

_LESS_THAN_SOLID = {2: ("vertex", "line"), 3: ("vertex", "line", "triangle", "quad")}


# meshes that Gmsh has made, as error bars and their runs ask for one several times: how many, and of how many nodes
_MADE: dict[tuple[Any, ...], Any] = {}
_KEPT, _MOST_KEPT = 4, 200_000


class MeshOfFile(NamedTuple):
    """Node coordinates (nodes, d) as in the file, the blocks (kind, (elements, nodes)) of solid elements, named groups,
    and kinds of elements of second order, of which the corners are taken."""

    points: np.ndarray
    blocks: list[tuple[str, np.ndarray]]
    groups: MeshGroups
    of_second_order: tuple[str, ...]


def read_with_meshio(path: str) -> Any:
    """A mesh of meshio. Raises SceneError for a file that it cannot read."""
    # a scene without a mesh is spared its half second
    import meshio

    printed = io.StringIO()
    try:
        # some readers print, and meshio leaves the program when none fits
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            if path.lower().endswith(".inp"):
                return read_abaqus(path)
            return read_gmsh_text(path) or complete_groups(meshio.read(path), path)
    except (Exception, SystemExit) as error:
        reason = " ".join(printed.getvalue().split()) or f"{type(error).__name__}: {error}"
        raise SceneError([f"expected a mesh that meshio reads, found {path} ({reason}{_remedy(path)})"]) from None


def read_file(path: str, dimension: int, stated: Any) -> Any:
    """A mesh of meshio of any file that is no imported one; geometry is meshed with the sizes of stated,
    `scene.shapes.BodyMesh`, and a mesh is made anew where it states a factor on them. Raises SceneError for one that
    cannot be used."""
    of_geometry = is_geometry(path, dimension)
    if not isinstance(stated, BodyMesh) or not (of_geometry or stated.size_factor != 1.0):
        return read_with_meshio(path)
    state = os.stat(path)
    key = (*stated.mesh_key, dimension, state.st_mtime_ns, state.st_size)
    if key in _MADE:
        return _MADE[key]
    if of_geometry:
        mesh = meshed(stated, dimension)
    else:
        mesh = remeshed(solid_mesh(read_with_meshio(path), dimension), stated.size_factor, path)
    if len(mesh.points) <= _MOST_KEPT:
        while len(_MADE) >= _KEPT:
            del _MADE[next(iter(_MADE))]
        _MADE[key] = mesh
    return mesh


def dimension_of(mesh: Any) -> int:
    """3 where a mesh of meshio has an element in space, else 2."""
    kinds = {OF_CORNERS.get(block.type, (block.type, None))[0] for block in mesh.cells if len(block.data)}
    return 3 if any(kind in ELEMENTS and ELEMENTS[kind].dimension == 3 for kind in kinds) else 2


def solid_mesh(mesh: Any, dimension: int) -> MeshOfFile:
    """What bodies in `dimension` take of a mesh of meshio. Raises SceneError for elements that have no particles."""
    mesh, of_second_order = _by_corners(mesh)
    known = kinds_in(dimension)
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
    points = np.asarray(mesh.points, float)
    for kind, cells in blocks:
        wrong = cells[(cells < 0) | (cells >= len(points))]
        if len(wrong):
            raise SceneError(
                [f"expected nodes from 0 to {len(points) - 1} in every element, found {wrong[0]} in a {kind}"]
            )
    if points.shape[1] < dimension or not np.isfinite(points).all():
        raise SceneError(
            [f"expected {dimension} finite coordinates a node, found {points.shape[1]} or some not finite"]
        )
    if points.shape[1] > dimension and not _is_plane(points, blocks):
        raise SceneError(["expected a plane mesh (one Z for all nodes) in 2-D, found nodes with different Z"])
    return MeshOfFile(np.ascontiguousarray(points[:, :dimension]), blocks, groups_of(mesh, dimension), of_second_order)


def kinds_in(dimension: int) -> list[str]:
    """The kinds of solid elements."""
    return [kind for kind, element in ELEMENTS.items() if element.dimension == dimension]


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
