"""Which places lie in the elements of a mesh, and meshes that lie in themselves."""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from parsolid.scene.elements import ELEMENTS, largest

# corners of the simplices that fill an element; a hexahedron's share its diagonal
_SIMPLICES = {
    "triangle": ((0, 1, 2),),
    "quad": ((0, 1, 2), (0, 2, 3)),
    "tetra": ((0, 1, 2, 3),),
    "hexahedron": tuple((0, *pair, 6) for pair in ((1, 2), (2, 3), (3, 7), (7, 4), (4, 5), (5, 1))),
    "wedge": ((0, 1, 2, 5), (0, 1, 4, 5), (0, 3, 4, 5)),
    "pyramid": ((0, 1, 2, 4), (0, 2, 3, 4)),
}
# places of the surface that are looked for in other elements: so far from a corner, so far below it, as shares
_FROM_CORNER, _BELOW = 0.05, 0.01
# cells of the grid that pairs are found on, over the mean box; cells along an axis of that which finds what is near
_CELL, _COUNTED = 0.75, {2: 1024, 3: 128}
# pairs of a place and an element that are looked at together
_TOGETHER = 200_000


class Solid:
    """What elements fill. points (n, d) [m]; blocks (kind, (elements, nodes)); facets of `boundary_facets`."""

    def __init__(self, points: np.ndarray, blocks: Any, facets: Any) -> None:
        self.points, self.blocks, self.facets = points, blocks, facets
        self.firsts = np.cumsum([0, *(len(cells) for _, cells in blocks)])
        self.lower = np.concatenate([_over_nodes(np.minimum, points, cells) for _, cells in blocks])
        self.upper = np.concatenate([_over_nodes(np.maximum, points, cells) for _, cells in blocks])
        self.surface = [np.zeros((len(cells), len(ELEMENTS[kind].facets)), bool) for kind, cells in blocks]
        for owner, nodes, _ in facets:
            for (kind, cells), first, marks in zip(blocks, self.firsts, self.surface):
                own = (owner >= first) & (owner < first + len(cells))
                for number, facet in enumerate(ELEMENTS[kind].facets):
                    if len(facet) == nodes.shape[1]:
                        same = (cells[owner[own] - first][:, facet] == nodes[own]).all(axis=1)
                        marks[owner[own][same] - first, number] = True

    def inside(self, places: np.ndarray, margin: float) -> np.ndarray:
        """Which places (n, d) are in the elements, farther from their common surface than a margin [m]."""
        found, near = np.zeros(len(places), bool), np.zeros(len(places), bool)
        for place, element in self._pairs(places, margin):
            for own, _, distance, outer in self._distances(places, place, element):
                within = (distance >= -margin).all(axis=1)
                found[own[within]] = True
                near[own[within & (outer & (distance <= margin)).any(axis=1)]] = True
        return found & ~near

    def within_itself(self) -> tuple[int, np.ndarray | None]:
        """How many facets of the surface have a place in an element that is not their own, and the first such place.

        How often space is covered changes at the surface alone, so elements that lie in one another nowhere along it
        do so nowhere.
        """
        owners, places, numbers = self._below_surface()
        wrong = np.zeros(len(places), bool)
        for place, element in self._pairs(places, 0.0):
            other = owners[place] != element
            for own, inside_of, distance, _ in self._distances(places, place[other], element[other]):
                size = largest(self.upper[inside_of] - self.lower[inside_of])
                wrong[own[-largest(-distance) > 1e-6 * size]] = True
        first = places[wrong][0] if wrong.any() else None
        return len(np.unique(numbers[wrong])), first

    def _below_surface(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Owning elements, places just below the corners and the middle of all facets, and the facets' numbers."""
        owners, places, numbers, total = [], [], [], 0
        for owner, nodes, _ in self.facets:
            corners = self.points[nodes]
            middle = corners.mean(axis=1)[:, None]
            chosen = np.concatenate([corners + _FROM_CORNER * (middle - corners), middle], axis=1)
            places.append((chosen + _BELOW * (self._middles(owner)[:, None] - chosen)).reshape(-1, corners.shape[2]))
            owners.append(np.repeat(owner, chosen.shape[1]))
            numbers.append(np.repeat(np.arange(total, total + len(owner)), chosen.shape[1]))
            total += len(owner)
        return np.concatenate(owners), np.concatenate(places), np.concatenate(numbers)

    def _middles(self, elements: np.ndarray) -> np.ndarray:
        """Means of the nodes (k, d) [m] of elements (k,)."""
        result = np.empty((len(elements), self.points.shape[1]))
        for (_, cells), first in zip(self.blocks, self.firsts):
            own = (elements >= first) & (elements < first + len(cells))
            result[own] = self.points[cells[elements[own] - first]].mean(axis=1)
        return result

    def _pairs(self, places: np.ndarray, margin: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """(numbers of places, numbers of elements) whose box, wider by a margin, has the place; found on a grid."""
        if not len(places):
            return
        lower, upper = self.lower - margin, self.upper + margin
        elements = np.flatnonzero(_may_have(lower, upper, places))
        if not len(elements):
            return
        extent = (upper - lower)[elements]
        size = max(_CELL * float(extent.mean()), float(extent.max()) / 50.0)
        origin = lower[elements].min(axis=0)
        first = np.floor((lower[elements] - origin) / size).astype(np.int64)
        count = np.floor((upper[elements] - origin) / size).astype(np.int64) - first + 1
        shape = (first + count).max(axis=0)
        repeat, place_in_box = _expanded(count.prod(axis=1))
        key, stride = np.zeros(len(repeat), np.int64), np.ones(len(repeat), np.int64)
        for i in range(places.shape[1]):
            key = key * shape[i] + first[repeat, i] + place_in_box // stride % count[repeat, i]
            stride *= count[repeat, i]
        order = np.argsort(key, kind="stable")
        key, holder = key[order], elements[repeat[order]]
        cell = np.floor((places - origin) / size).astype(np.int64)
        known = ((cell >= 0) & (cell < shape)).all(axis=1)
        wanted = np.ravel_multi_index(tuple(np.where(known[:, None], cell, 0).T), tuple(shape))
        begins, stops = np.searchsorted(key, wanted, "left"), np.searchsorted(key, wanted, "right")
        many = np.where(known, stops - begins, 0)
        ends = np.cumsum(many)
        cuts = np.searchsorted(ends, np.arange(_TOGETHER, ends[-1] + _TOGETHER, _TOGETHER), "right")
        for begin, end in zip([0, *cuts], [*cuts, len(places)]):
            which, step = _expanded(many[begin:end])
            which = which + begin
            element = holder[begins[which] + step]
            for place, low, high in zip(places.T, lower.T, upper.T):
                held = (place[which] >= low[element]) & (place[which] <= high[element])
                which, element = which[held], element[held]
            yield which, element

    def _distances(
        self, places: np.ndarray, place: np.ndarray, element: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """For the simplices of the elements of pairs: numbers of places and elements, distances (k, d + 1) [m] above
        the simplices' facets, and which of those are of the surface."""
        for (kind, cells), first, marks in zip(self.blocks, self.firsts, self.surface):
            own = (element >= first) & (element < first + len(cells))
            facets = ELEMENTS[kind].facets
            for corners in _SIMPLICES[kind] if own.any() else ():
                nodes = self.points[cells[element[own] - first][:, corners]]
                outer = np.zeros((len(nodes), len(corners)), bool)
                for i, left_out in enumerate(corners):
                    rest = set(corners) - {left_out}
                    for number, facet in enumerate(facets):
                        if rest <= set(facet):
                            outer[:, i] = marks[element[own] - first, number]
                yield place[own], element[own], _above_facets(nodes, places[place[own]]), outer


def _over_nodes(bound: np.ufunc, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The minimum or maximum (elements, d) [m] of the nodes of each element."""
    result = points[cells[:, 0]]
    for nodes in cells.T[1:]:
        bound(result, points[nodes], out=result)
    return result


def _may_have(lower: np.ndarray, upper: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Which boxes (n,) may have any of the places, by the numbers of places that cells of a grid have, summed up."""
    d, cells = places.shape[1], _COUNTED[places.shape[1]]
    origin = places.min(axis=0)
    size = np.maximum(np.ptp(places, axis=0), 1e-300) / cells
    index = np.minimum((places - origin) / size, cells - 1).astype(np.int64)
    flat = np.ravel_multi_index(tuple(index.T), (cells,) * d)
    table = np.pad(np.bincount(flat, minlength=cells**d).reshape((cells,) * d), (1, 0))
    for axis in range(d):
        table = table.cumsum(axis=axis)
    # a cell more on either side, for round-off
    first = np.clip(np.floor((lower - origin) / size) - 1, 0, cells).astype(np.int64)
    last = np.clip(np.floor((upper - origin) / size) + 2, 0, cells).astype(np.int64)
    count = np.zeros(len(lower), np.int64)
    for corner in product((0, 1), repeat=d):
        ends = tuple(np.where(side, last[:, i], first[:, i]) for i, side in enumerate(corner))
        count += (-1) ** (d - sum(corner)) * table[ends]
    return count > 0


def _expanded(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each number i repeated counts[i] times, and 0, 1, ... within each."""
    which = np.repeat(np.arange(len(counts)), counts)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)


def _above_facets(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Distances (k, d + 1) [m] of places from the facets opposite to the corners (k, d + 1, d), positive inside."""
    count, d = len(corners), corners.shape[2]
    edges = np.ascontiguousarray((corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0))
    # gradients of the shares of the corners, times the determinant: of all but the first, which has what is left
    if d == 2:
        a, b = edges
        others = [np.stack([b[1], -b[0]]), np.stack([-a[1], a[0]])]
    else:
        others = [_cross(edges[i], edges[j]) for i, j in ((1, 2), (2, 0), (0, 1))]
    turned = np.sign((others[0] * edges[0]).sum(axis=0))
    result = np.empty((count, d + 1))
    for i, gradient in enumerate([-np.sum(others, axis=0), *others]):
        arm = (places - corners[:, (i + 1) % (d + 1)]).T
        result[:, i] = turned * (gradient * arm).sum(axis=0) / np.sqrt((gradient * gradient).sum(axis=0))
    return result


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b (3, n)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
