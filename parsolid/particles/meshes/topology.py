"""What a large mesh's topology asks for: facets of one element, edges, elements that are there twice; all by sorting,
of slices of the mesh on every rank."""

import numpy as np
from mpi4py import MPI

from decomposition.migration import migrate
from parsolid.checksums import mixed
from parsolid.particles.meshes.elements import ELEMENTS, facet_areas, lumped_volumes
from parsolid.particles.meshes.slices import MeshSlices, first_place
from parsolid.scene.validation_errors import MeshFault, SceneError, place_in_words

# of the whole mesh, after the last element
_NONE = np.iinfo(np.int64).max
_SEEDS = np.array([0x243F6A8885A308D3, 0x13198A2E03707344], np.uint64)

Facets = list[tuple[np.ndarray, np.ndarray, np.ndarray]]


def sound_volumes(mesh: MeshSlices) -> tuple[list[np.ndarray], int]:
    """Volumes (own elements, nodes) [m^3] of each block lumped to the nodes, and how many elements of all ranks are
    turned inside out, but wedges: programs do not agree on their order.

    Raises SceneError, on all ranks, where elements are inside out or flat. Collective.
    """
    lumped, numbers, counts, places = [], [], [], []
    start, points, inverted = 0, mesh.local.points, 0
    for kind, cells in mesh.local.blocks:
        volumes, sound, turned = lumped_volumes(kind, points[cells])
        inverted += int(turned.sum()) if kind != "wedge" else 0
        bad = np.flatnonzero(~sound)
        lumped.append(volumes)
        counts.append(len(bad))
        numbers.append(int(mesh.local.numbers[start + bad[0]]) if len(bad) else _NONE)
        places.append(points[cells[bad[:1]]].mean(axis=1).ravel() if len(bad) else np.full(points.shape[1], np.inf))
        start += len(cells)
    total = mesh.comm.allreduce(np.array(counts))
    for b in np.flatnonzero(total)[:1]:
        place = first_place(mesh.comm, numbers[b], places[b])
        found = (
            f"{total[b]} {mesh.local.blocks[b][0]} elements inside out or flat, the first at ({place_in_words(place)})"
        )
        raise SceneError([MeshFault("element", "elements of positive volume", found)])
    return lumped, mesh.comm.allreduce(inverted)


def refuse_repeated(mesh: MeshSlices) -> None:
    """Raise SceneError, on all ranks, when an element is there twice, on the same nodes or on others at the same
    places. Collective.

    Elements are told apart by two sums of 64 bits over what is mixed of the places of their nodes.
    """
    comm, points = mesh.comm, mesh.local.points
    # the zeros of both signs are one
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)
    of_nodes = np.repeat(_SEEDS[None], len(points), axis=0)
    for column in bits.T:
        of_nodes = mixed(of_nodes * _SEEDS[1] + column[:, None])
    ends = np.cumsum([0, *(len(cells) for _, cells in mesh.local.blocks)])
    for kind in dict.fromkeys(kind for kind, _ in mesh.local.blocks):
        own = [b for b, (other, _) in enumerate(mesh.local.blocks) if other == kind]
        cells = np.concatenate([mesh.local.blocks[b][1] for b in own])
        number = np.concatenate([mesh.local.numbers[ends[b] : ends[b + 1]] for b in own])
        keys = np.zeros((len(cells), 2), np.uint64)
        for column in cells.T:
            keys += of_nodes[column]
        keeper = (keys[:, 0] % np.uint64(comm.size)).astype(np.int64)
        come = migrate(comm, keeper, {"keys": keys, "number": number})
        repeated, first = _repeated(come["keys"], come["number"])
        total, least = comm.allreduce(repeated), comm.allreduce(first, MPI.MIN)
        if total:
            row = np.searchsorted(number, least)
            here = row < len(number) and number[row] == least
            place = points[cells[row]].mean(axis=0) if here else np.full(points.shape[1], np.inf)
            found = f"{total} {kind} elements more than once, the first at "
            found += f"({place_in_words(first_place(comm, 0 if here else 1, place))})"
            raise SceneError([MeshFault("repeated", "every element once", found)])


def _repeated(keys: np.ndarray, number: np.ndarray) -> tuple[int, int]:
    """How many different keys (n, 2) are there more than once, and the least number (n,) of these."""
    order = np.argsort(keys[:, 0], kind="stable")
    same = (keys[order[1:]] == keys[order[:-1]]).all(axis=1)
    if not same.any():
        return 0, _NONE
    begins = same & ~np.append(False, same[:-1])
    return int(begins.sum()), int(number[order[:-1][same]].min())


def mean_edge(mesh: MeshSlices) -> np.ndarray:
    """Mean length (own nodes,) [m] of the edges that meet in each node; 0 for nodes of no element. Collective."""
    local = mesh.local
    total = max(len(local.nodes), 1)
    edges = [(cells, edge) for kind, cells in local.blocks for edge in ELEMENTS[kind].edges]
    ends = [(cells[:, edge[0]], cells[:, edge[1]]) for cells, edge in edges]
    keys = np.concatenate([np.minimum(*both) * total + np.maximum(*both) for both in ends])
    keys.sort()
    keys = keys[np.append(True, keys[1:] != keys[:-1])] if len(keys) else keys
    start, end = keys // total, keys % total
    length = np.linalg.norm(local.points[start] - local.points[end], axis=1)
    # an edge of several ranks has the same length on all
    come = mesh.nodes.deliver(local.nodes[start], end=local.nodes[end], length=length)
    count = len(mesh.nodes)
    if mesh.comm.size > 1:
        _, first = np.unique(come["number"] * mesh.nodes.count + come["end"], return_index=True)
        come = {name: values[first] for name, values in come.items()}
    # of no edges at all a count is one of integers, to which lengths cannot be added
    summed = np.bincount(come["number"], come["length"], minlength=count).astype(float)
    met = np.bincount(come["number"], minlength=count)
    others = mesh.nodes.deliver(come["end"], length=come["length"])
    # one edge after the other, as if both ends stood in one list
    np.add.at(summed, others["number"], others["length"])
    met += np.bincount(others["number"], minlength=count)
    return np.asarray(summed / np.maximum(met, 1))


def boundary_facets(mesh: MeshSlices) -> Facets:
    """(own element, counted from this rank's first; local nodes; outward area vector) of the facets that belong to one
    element only, by number of nodes. Collective."""
    points = mesh.local.points
    # by number of nodes: first element of the block, its cells, and which of their nodes make the facet
    gathered: dict[int, list[tuple[int, np.ndarray, tuple[int, ...]]]] = {}
    first = 0
    for kind, cells in mesh.local.blocks:
        for facet in ELEMENTS[kind].facets:
            gathered.setdefault(len(facet), []).append((first, cells, facet))
        first += len(cells)
    result = []
    for pieces in gathered.values():
        single = _of_one_element(pieces, len(points))
        starts = np.cumsum([0, *(len(cells) for _, cells, _ in pieces)])
        found = []
        for (first, cells, facet), low, high in zip(pieces, starts, starts[1:]):
            own = single[np.searchsorted(single, low) : np.searchsorted(single, high)] - low
            nodes = cells[own][:, facet]
            found.append((first + own, nodes, facet_areas(points[nodes], points[cells[own]].mean(axis=1))))
        owner, nodes, areas = (np.concatenate(column) for column in zip(*found))
        if mesh.comm.size > 1:
            rows = np.sort(mesh.local.nodes[nodes], axis=1)
            # a facet of two elements of a rank is inside for good: no third one is on its other side
            alone = mesh.nodes.ask(rows[:, 0], lambda asked: occur_once(asked["rows"]), rows=rows)
            owner, nodes, areas = owner[alone], nodes[alone], areas[alone]
        result.append((owner, nodes, areas))
    return result


def _of_one_element(pieces: list[tuple[int, np.ndarray, tuple[int, ...]]], total: int) -> np.ndarray:
    """Numbers, rising, of the facets that are there once, counted over all pieces."""
    width = len(pieces[0][2])
    if total**width < 2**63:
        keys = np.concatenate([_key(np.sort(cells[:, facet], axis=1), total) for _, cells, facet in pieces])
        order = np.argsort(keys)
        ordered = keys[order]
        differs = ordered[1:] != ordered[:-1]
        return np.sort(order[np.append(True, differs) & np.append(differs, True)]) if len(order) else order
    return np.flatnonzero(occur_once(np.concatenate([np.sort(c[:, facet], axis=1) for _, c, facet in pieces])))


def occur_once(rows: np.ndarray) -> np.ndarray:
    """Which rows (n, k) are there once (n,) bool."""
    order = np.lexsort(rows.T[::-1])
    differs = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    result = np.ones(len(rows), bool)
    if len(rows):
        result[order] = np.append(True, differs) & np.append(differs, True)
    return result


def _key(rows: np.ndarray, total: int) -> np.ndarray:
    result = rows[:, 0].copy()
    for column in rows.T[1:]:
        result *= total
        result += column
    return result
