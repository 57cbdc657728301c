"""A mesh on all ranks, each with a slice of its nodes and a compact part of its elements: a file is read once, by one
rank or by all in slices."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.bisection import bisect
from decomposition.migration import migrate
from decomposition.slices import Slices
from parsolid.checksums import added, sum_of_rows
from parsolid.collective import anywhere
from parsolid.particles.agreement import agree
from parsolid.particles.meshes.files import MeshOfFile, read_file, solid_mesh
from parsolid.particles.meshes.groups import MeshGroups
from parsolid.particles.meshes.imported import Contents, ImportedMesh, contents_of, is_imported, mesh_of
from parsolid.scene.validation_errors import MeshFault, SceneError, suggestion

_READER = 0


@dataclass
class LocalMesh:
    """A rank's own elements, near one another, by local numbers of their nodes. nodes (k,): numbers in the whole mesh,
    rising; points (k, d) [m]; blocks (kind, (own elements, nodes)): of all blocks of the mesh; numbers (own elements,):
    in the whole mesh, rising."""

    nodes: np.ndarray
    points: np.ndarray
    blocks: list[tuple[str, np.ndarray]]
    numbers: np.ndarray


@dataclass
class MeshSlices:
    """This rank's slices of a mesh.

    nodes, elements: which numbers it keeps, elements counted over all blocks; points (kept nodes, d) [m]; local: own
    elements, wherever their numbers are kept; groups: kept nodes, kept elements, and facets of which the first node is
    kept; facet_names: of all groups with facets; of_second_order: kinds of such elements.
    """

    comm: Any
    nodes: Slices
    elements: Slices
    points: np.ndarray
    local: LocalMesh
    groups: MeshGroups
    facet_names: frozenset[str]
    of_second_order: tuple[str, ...]


def whole_mesh(comm: Any, stated: Any, dimension: int, meshes: dict[Any, MeshSlices]) -> MeshSlices:
    """The whole mesh of a body, stated: `scene.shapes.BodyMesh`; meshes: those that have been read, by their keys, to
    which it is added. Raises SceneError as `read_slices`. Collective."""
    if stated.mesh_key not in meshes:
        meshes[stated.mesh_key] = read_slices(comm, stated, dimension)
    return meshes[stated.mesh_key]


def part_of_body(mesh: MeshSlices, stated: Any) -> MeshSlices:
    """The elements of a body, which may be those of a group. Raises SceneError as `restricted`. Collective."""
    return mesh if stated.group is None else restricted(mesh, [stated.group])


def restricted(mesh: MeshSlices, groups: Sequence[str]) -> MeshSlices:
    """A mesh with the elements of some groups alone; numbers stay. Raises SceneError on all ranks for one without
    solid elements. Collective."""
    kept = np.zeros(len(mesh.elements), bool)
    for group in groups:
        own = mesh.groups.elements.get(group, np.zeros(0, np.int64))
        if not mesh.comm.allreduce(len(own)):
            known = sorted(mesh.groups.elements)
            told = ", ".join(map(repr, known)) or "there is none"
            expected = f"a group of solid elements ({told}){suggestion(group, known)}"
            raise SceneError([MeshFault("unknown-name", expected, repr(group), "group")])
        kept[own - mesh.elements.first] = True
    chosen, local = mesh.elements.fetch(mesh.local.numbers, kept), mesh.local
    blocks, start = [], 0
    for kind, cells in local.blocks:
        blocks.append((kind, cells[chosen[start : start + len(cells)]]))
        start += len(cells)
    used, blocks = numbered(blocks)
    part = LocalMesh(local.nodes[used], local.points[used], blocks, local.numbers[chosen])
    return replace(mesh, local=part)


def numbered(blocks: list[tuple[str, np.ndarray]]) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
    """Nodes (k,), rising, that blocks have, and the blocks by the nodes' places among these."""
    filled = [cells for _, cells in blocks if len(cells)]
    if not filled:
        return np.zeros(0, np.int64), blocks
    low, high = min(int(cells.min()) for cells in filled), max(int(cells.max()) for cells in filled) + 1
    if high - low <= 4 * sum(cells.size for cells in filled):
        met = np.zeros(high - low, bool)
        for cells in filled:
            met[cells - low] = True
        place = np.cumsum(met) - 1
        return np.flatnonzero(met) + low, [(kind, place[cells - low]) for kind, cells in blocks]
    nodes = np.unique(np.concatenate([cells.ravel() for cells in filled]))
    return nodes, [(kind, np.searchsorted(nodes, cells)) for kind, cells in blocks]


def read_slices(comm: Any, stated: Any, dimension: int) -> MeshSlices:
    """Every rank's slices of a mesh file, stated: `scene.shapes.MeshFile`. Raises SceneError, on all ranks, for one
    that cannot be used. Collective.

    An imported mesh is read by all, each its slices alone; any other file by one rank, which sends slices on.
    """
    path, scale = stated.file, stated.scale
    imported = agreed(comm, lambda: is_imported(path))
    if imported and getattr(stated, "size_factor", 1.0) != 1.0:
        raise SceneError([MeshFault("geometry", "1 for an imported mesh", f"{stated.size_factor:g}", "size_factor")])
    read = _read_imported if imported else _read_and_scatter
    contents, counts, mesh = read(comm, stated, dimension)
    nodes, elements = Slices(comm, counts[0]), Slices(comm, sum(counts[1:]))
    with np.errstate(over="ignore", invalid="ignore"):
        points = mesh.points * scale
    if anywhere(comm, not np.isfinite(points).all()):
        raise SceneError([f"expected {dimension} finite coordinates a node, found some not finite"])
    groups = _at_keepers(contents, mesh.groups, nodes, elements)
    facet_names = frozenset(name for name, _ in contents.facets)
    local = _local(comm, mesh.blocks, nodes, points, elements.first)
    return MeshSlices(comm, nodes, elements, points, local, groups, facet_names, tuple(contents.of_second_order))


def _local(comm: Any, blocks: list[tuple[str, np.ndarray]], nodes: Slices, points: np.ndarray, first: int) -> LocalMesh:
    """A compact part of the elements for every rank, of slices of blocks whose first element has a number."""
    own, local = numbered(blocks)
    places = nodes.fetch(own, points)
    numbers = first + np.arange(sum(len(cells) for _, cells in blocks))
    if comm.size == 1:
        return LocalMesh(own, places, local, numbers)
    middles = np.concatenate([places[cells].mean(axis=1) for _, cells in local])
    owner, start, moved, order = bisect(comm, middles), 0, [], []
    for kind, cells in blocks:
        part = slice(start, start + len(cells))
        come = migrate(comm, owner[part], {"cells": cells, "number": numbers[part]})
        rising = np.argsort(come["number"])
        moved.append((kind, come["cells"][rising]))
        order.append(come["number"][rising])
        start += len(cells)
    own, local = numbered(moved)
    return LocalMesh(own, nodes.fetch(own, points), local, np.concatenate(order))


def agreed(comm: Any, ask: Any) -> Any:
    """What one rank finds out, on all ranks, or its SceneError."""
    found: Any = None
    if comm.rank == _READER:
        try:
            found = ask()
        except SceneError as error:
            found = error
    # until all ranks are here, without the processor that the reader may need
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(0.002)
    found = comm.bcast(found, _READER)
    if isinstance(found, SceneError):
        raise found
    return found


def _slices_of(comm: Any, shapes: dict[str, tuple[int, ...]], rank: int) -> dict[str, Any]:
    """First and last row of each array that a rank gets: of elements, those of its slice of all."""
    elements = [name for name in shapes if name.startswith("elements/")]
    first, last = Slices(comm, sum(shapes[name][0] for name in elements)).bounds(rank)
    result, start = {}, 0
    for name, (count, *_) in shapes.items():
        if name in elements:
            low, high = (min(max(end - start, 0), count) for end in (first, last))
            result[name], start = (low, high), start + count
        else:
            result[name] = Slices(comm, count).bounds(rank)
    return result


def _counts(contents: Contents, shapes: dict[str, tuple[int, ...]]) -> list[int]:
    """Of all nodes, and of the elements of each block."""
    return [shapes["points"][0], *(shapes[f"elements/{b}"][0] for b in range(len(contents.kinds)))]


def _read_imported(comm: Any, stated: Any, dimension: int) -> tuple[Contents, list[int], MeshOfFile]:
    path = stated.file

    def look() -> tuple[Contents, dict[str, Any]]:
        with ImportedMesh(path, dimension) as imported:
            return imported.contents, imported.shapes

    contents, shapes = agreed(comm, look)
    arrays: dict[str, np.ndarray] = {}
    sums, faults = dict.fromkeys(shapes, 0), []
    try:
        with ImportedMesh(path, dimension) as imported:
            for name, (first, last) in _slices_of(comm, shapes, comm.rank).items():
                arrays[name] = imported.rows(name, first, last)
                sums[name] = sum_of_rows(arrays[name], first)
    except SceneError as error:
        faults = error.faults
    agree(comm, faults)
    sums = added(comm, sums)
    agreed(comm, lambda: imported.compare(sums))
    return contents, _counts(contents, shapes), mesh_of(contents, arrays)


def _read_and_scatter(comm: Any, stated: Any, dimension: int) -> tuple[Contents, list[int], MeshOfFile]:
    whole: dict[str, np.ndarray] = {}

    path = stated.file

    def read() -> tuple[Contents, dict[str, Any]]:
        contents, arrays = contents_of(solid_mesh(read_file(path, dimension, stated), dimension), dimension)
        whole.update(arrays)
        return contents, {name: (array.shape, array.dtype.str) for name, array in arrays.items()}

    contents, layout = agreed(comm, read)
    shapes = {name: shape for name, (shape, _) in layout.items()}
    arrays = {}
    for name, (shape, kind) in layout.items():
        if comm.rank == _READER:
            # in turn, and forgotten then: the reader has one copy of what is left
            array = np.ascontiguousarray(whole.pop(name))
            for rank in range(comm.size):
                first, last = _slices_of(comm, shapes, rank)[name]
                if rank != _READER and first < last:
                    comm.Send(array[first:last].view(np.int64), rank)
            first, last = _slices_of(comm, shapes, _READER)[name]
            arrays[name] = array if comm.size == 1 else array[first:last].copy()
        else:
            first, last = _slices_of(comm, shapes, comm.rank)[name]
            arrays[name] = np.empty((last - first, *shape[1:]), kind)
            if first < last:
                comm.Recv(arrays[name].view(np.int64), _READER)
    return contents, _counts(contents, shapes), mesh_of(contents, arrays)


def _at_keepers(contents: Contents, groups: MeshGroups, nodes: Slices, elements: Slices) -> MeshGroups:
    """Groups of which every rank has a slice, each member with the rank that keeps it; facets by their first node."""
    result = MeshGroups({}, {}, {})
    for slices, names, stated, kept in (
        (nodes, contents.nodes, groups.nodes, result.nodes),
        (elements, contents.elements, groups.elements, result.elements),
    ):
        if names:
            number = np.repeat(np.arange(len(names)), [len(stated[name]) for name in names])
            come = slices.deliver(np.concatenate([stated[name] for name in names]), group=number)
            for i, name in enumerate(names):
                kept[name] = np.sort(come["number"][come["group"] == i]) + slices.first
    for name, width in contents.facets:
        rows = groups.facets[name][width]
        result.facets.setdefault(name, {})[width] = nodes.deliver(rows[:, 0], rows=rows)["rows"]
    return result


def first_place(comm: MPI.Comm, number: int, place: np.ndarray) -> np.ndarray:
    """The place (d,) of the rank whose number is the least; collective."""
    least = comm.allreduce(number, MPI.MIN)
    mine, result = np.where(number == least, place, np.inf), np.empty(len(place))
    comm.Allreduce(mine, result, MPI.MIN)
    return result
