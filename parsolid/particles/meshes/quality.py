"""Faults of meshes that elements one by one do not show, and their quality in numbers."""

from typing import Any, NamedTuple

import numpy as np

from decomposition.migration import migrate
from parsolid.collective import maximum, minimum
from parsolid.particles.meshes.elements import ELEMENTS, facet_areas, lumped_volumes
from parsolid.particles.meshes.slices import MeshSlices, first_place
from parsolid.particles.meshes.topology import Facets
from parsolid.scene.validation_errors import MeshFault, SceneError, place_in_words

# of the shortest mean edge, within which two nodes are at one place
_ONE_PLACE = 1e-6
# bins of logarithms of what is sorted
_BINS = 400


def refuse_double_nodes(mesh: MeshSlices, used: np.ndarray, edge: np.ndarray) -> None:
    """Raise SceneError, on all ranks, for nodes of elements at one place, which nothing joins; used (kept nodes,):
    those of elements; edge (kept nodes,) [m]: see `topology.mean_edge`. Collective."""
    comm, own = mesh.comm, np.flatnonzero(used)
    length = minimum(comm, float(edge[own].min(initial=np.inf)))
    cells = np.rint(mesh.points[own] / (_ONE_PLACE * length)).astype(np.int64)
    keeper = (np.abs(cells.sum(axis=1)) % comm.size).astype(np.int64)
    come = migrate(comm, keeper, {"cells": cells, "place": mesh.points[own], "number": mesh.nodes.first + own})
    order = np.lexsort((come["number"], *come["cells"].T))
    same = (come["cells"][order[1:]] == come["cells"][order[:-1]]).all(axis=1)
    _refuse(mesh, "double-node", "one node at a place", "nodes at the place of another", come, order[1:][same])


def refuse_hinges(mesh: MeshSlices, facets: Facets) -> None:
    """Raise SceneError, on all ranks, where elements share nothing but an edge (in the plane a node); facets: of the
    surface. Collective."""
    edges, sides = [np.zeros((0, 2), np.int64)], [np.zeros((0, 4), np.int64)]
    for _, nodes, _ in facets:
        own = mesh.local.nodes[nodes]
        padded = np.pad(own, ((0, 0), (0, 4 - own.shape[1])), constant_values=-1)
        sides += [padded] * own.shape[1]
        if own.shape[1] == 2:
            edges += [np.repeat(own[:, i, None], 2, axis=1) for i in range(2)]
        else:
            edges += [np.sort(own[:, [i, (i + 1) % own.shape[1]]], axis=1) for i in range(own.shape[1])]
    rows = np.concatenate(edges)
    places = mesh.nodes.fetch(rows[:, 0], mesh.points)
    come = mesh.nodes.deliver(rows[:, 0], rows=rows, place=places, side=np.concatenate(sides))
    order = np.lexsort(come["rows"].T[::-1])
    different, first, count = np.unique(come["rows"][order], axis=0, return_index=True, return_counts=True)
    found = {"place": come["place"][order[first]], "number": different[:, 0]}
    many = np.flatnonzero(count > 2)
    parted = np.array([_unmatched(come["side"][order[first[i] : first[i] + count[i]]]) > 2 for i in many], bool)
    what = "nodes" if mesh.points.shape[1] == 2 else "edges"
    expected = f"elements that share more than {what} alone"
    _refuse(mesh, "edge-contact", expected, f"{what} at which parts hinge", found, many[parted])


def _unmatched(sides: np.ndarray) -> int:
    """How many facets at an edge, nodes (k, 4), -1 where it has fewer, are not a quad beside its half, a triangle:
    elements of two kinds may share four nodes so."""
    nodes = [{node for node in row if node >= 0} for row in sides.tolist()]
    halved = [one for one in nodes if len(one) == 4 and any(len(other) == 3 and other < one for other in nodes)]
    return len(nodes) - 2 * len(halved)


def _refuse(
    mesh: MeshSlices, code: str, expected: str, words: str, found: dict[str, np.ndarray], bad: np.ndarray
) -> None:
    """Raise SceneError with how many bad (k,) rows of places and numbers all ranks have, and the first place."""
    total = mesh.comm.allreduce(len(bad))
    if not total:
        return
    least = bad[np.argmin(found["number"][bad])] if len(bad) else -1
    number = int(found["number"][least]) if len(bad) else np.iinfo(np.int64).max
    place = found["place"][least] if len(bad) else np.full(mesh.points.shape[1], np.inf)
    told = f"{total} {words}, the first at ({place_in_words(first_place(mesh.comm, number, place))})"
    raise SceneError([MeshFault(code, expected, told)])


class Quality(NamedTuple):
    """Of all elements the worst aspect and that which 1 % exceed, the shortest edge [m] and where it is (d,) [m], and
    that below which 1 % of the elements have one."""

    worst: float
    high: float
    shortest: float
    place: np.ndarray
    short: float


def quality_of(mesh: MeshSlices) -> Quality:
    """Aspects are the longest edge over the least height, 1 of a square, 1.22 of a regular tetrahedron. Collective."""
    d, comm = mesh.points.shape[1], mesh.comm
    aspects, edges, places = [np.zeros(0)], [np.zeros(0)], [np.zeros((0, d))]
    for kind, cells in mesh.local.blocks:
        if len(cells):
            aspect, edge, place = _of_elements(kind, mesh.local.points[cells])
            aspects.append(aspect)
            edges.append(edge)
            places.append(place)
    aspect, edge, place = (np.concatenate(one) for one in (aspects, edges, places))
    shortest = minimum(comm, float(edge.min(initial=np.inf)))
    here = np.flatnonzero(edge == shortest)
    numbers = mesh.local.numbers[here]
    first = int(np.argmin(numbers)) if len(here) else -1
    number = int(numbers[first]) if len(here) else np.iinfo(np.int64).max
    where = first_place(comm, number, place[here[first]] if len(here) else np.full(d, np.inf))
    worst = maximum(comm, float(aspect.max(initial=0.0)))
    longest = maximum(comm, float(edge.max(initial=0.0)))
    high = _quantile(comm, aspect, 0.99, 1.0, max(worst, 1.0 + 1e-9))
    short = _quantile(comm, edge, 0.01, shortest, max(longest, shortest * (1.0 + 1e-9)))
    return Quality(worst, min(high, worst), shortest, where, max(short, shortest))


def _of_elements(kind: str, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Aspects, shortest edges [m] (n,) and their middles (n, d) [m] of elements with corners (n, nodes, d) [m]."""
    element, d = ELEMENTS[kind], corners.shape[2]
    ends = np.array(element.edges)
    length = np.linalg.norm(corners[:, ends[:, 0]] - corners[:, ends[:, 1]], axis=2)
    least = np.argmin(length, axis=1)
    rows = np.arange(len(corners))
    middle = 0.5 * (corners[rows, ends[least, 0]] + corners[rows, ends[least, 1]])
    volume = lumped_volumes(kind, corners)[0].sum(axis=1)
    inner, pointed = corners.mean(axis=1), element.product is None or kind == "pyramid"
    height = np.full(len(corners), np.inf)
    for facet in element.facets:
        area = np.linalg.norm(facet_areas(corners[:, facet], inner), axis=1)
        # volume over area and height: 1/d of what ends in a point over the facet, 1/2 in an edge
        part = d if pointed else 2 if kind == "wedge" and len(facet) == 4 else 1
        height = np.minimum(height, part * volume / area)
    return length.max(axis=1) / height, length[rows, least], middle


def _quantile(comm: Any, values: np.ndarray, part: float, low: float, high: float) -> float:
    """That which a part of all values is below, within 1/400 of the range of logarithms; the same on any ranks."""
    edges = np.exp(np.linspace(np.log(low), np.log(high), _BINS + 1))
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, _BINS - 1)
    count = comm.allreduce(np.bincount(place, minlength=_BINS))
    return float(edges[1 + np.searchsorted(np.cumsum(count), part * count.sum())])
