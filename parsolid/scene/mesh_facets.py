"""What a large mesh's topology asks for: facets of one element, edges, rows that are there twice; all by sorting."""

from typing import Any

import numpy as np

from parsolid.scene.elements import ELEMENTS, facet_areas


def order_and_groups(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """An order (n,) that brings equal rows of (n, k) together, and where in it another row begins (n,) bool."""
    order = np.lexsort(rows.T[::-1])
    begins = np.ones(len(rows), bool)
    begins[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    return order, begins


def numbers_of_places(points: np.ndarray) -> np.ndarray:
    """A number (n,) of each point's place (n, d), the same for points at one place."""
    order, begins = order_and_groups(points)
    result = np.empty(len(points), np.int64)
    result[order] = np.cumsum(begins) - 1
    return result


def repeated_rows(rows: np.ndarray) -> tuple[int, int]:
    """How many different rows are there more than once, and the number of the first of them."""
    order, begins = order_and_groups(rows)
    starts = np.flatnonzero(begins)
    again = np.diff(np.append(starts, len(rows))) > 1
    if not again.any():
        return 0, -1
    # of equal rows the order keeps the first one first
    return int(again.sum()), int(order[starts[again]].min())


def mean_edge(points: np.ndarray, blocks: Any) -> np.ndarray:
    """Mean length [m] of the edges that meet in each node; 0 for nodes of no element."""
    total = len(points)
    keys = np.concatenate([_edge_keys(cells, edge, total) for kind, cells in blocks for edge in ELEMENTS[kind].edges])
    keys.sort()
    keys = keys[np.append(True, keys[1:] != keys[:-1])]
    start, end = keys // total, keys % total
    length = np.linalg.norm(points[start] - points[end], axis=1)
    summed = np.bincount(start, length, minlength=total)
    # one edge after the other, as if both ends stood in one list
    np.add.at(summed, end, length)
    met = np.bincount(start, minlength=total) + np.bincount(end, minlength=total)
    return np.asarray(summed / np.maximum(met, 1))


def _edge_keys(cells: np.ndarray, edge: tuple[int, int], total: int) -> np.ndarray:
    first, second = cells[:, edge[0]], cells[:, edge[1]]
    return np.asarray(np.minimum(first, second) * total + np.maximum(first, second))


def boundary_facets(points: np.ndarray, blocks: Any) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """(owning element, nodes, outward area vector) of the facets that belong to one element only, by number
    of nodes.
    """
    # by number of nodes: first element of the block, its cells, and which of their nodes make the facet
    gathered: dict[int, list[tuple[int, np.ndarray, tuple[int, ...]]]] = {}
    first = 0
    for kind, cells in blocks:
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
    else:
        rows = np.concatenate([np.sort(cells[:, facet], axis=1) for _, cells, facet in pieces])
        order, begins = order_and_groups(rows)
        differs = begins[1:]
    alone = np.append(True, differs) & np.append(differs, True)
    return np.sort(order[alone])


def _key(rows: np.ndarray, total: int) -> np.ndarray:
    result = rows[:, 0].copy()
    for column in rows.T[1:]:
        result *= total
        result += column
    return result
