"""Which places lie in the elements of a mesh, and meshes that lie in themselves.

Places and the elements that may have some are brought together rank by rank, by a bisection of the places.
"""

from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from decomposition.bisection import cut_points, keys_of
from decomposition.migration import migrate
from parsolid.particles.meshes.elements import ELEMENTS, largest
from parsolid.particles.meshes.slices import MeshSlices, first_place
from parsolid.particles.meshes.topology import Facets

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
# part of a short edge within which a node is on a facet, or at another node
_ROUNDING = 1e-6
# cells of the grid that pairs are found on, over the mean box; cells along an axis of that which finds what is near
_CELL, _COUNTED = 0.75, {2: 1024, 3: 128}
# pairs of a place and an element that are looked at together
_TOGETHER = 200_000


class _Block(NamedTuple):
    """Elements of one kind: corners (n, nodes, d) [m], numbers (n,) in the mesh, facets on its surface (n, facets)."""

    kind: str
    corners: np.ndarray
    number: np.ndarray
    surface: np.ndarray


class Solid:
    """What the elements of a mesh fill, of which every rank has its own; facets: of `topology.boundary_facets`."""

    def __init__(self, mesh: MeshSlices, facets: Facets) -> None:
        self.mesh, self.comm, self.facets = mesh, mesh.comm, facets
        points, blocks = mesh.local.points, mesh.local.blocks
        self.firsts = np.cumsum([0, *(len(cells) for _, cells in blocks)])
        self.lower, self.upper = (
            np.concatenate([_over_nodes(bound, points, cells) for _, cells in blocks])
            for bound in (np.minimum, np.maximum)
        )
        self.sides = [self._sides(owner, nodes) for owner, nodes, _ in facets]
        self.surface = [np.zeros((len(cells), len(ELEMENTS[kind].facets)), bool) for kind, cells in blocks]
        for (owner, _, _), side in zip(facets, self.sides):
            for first, marks in zip(self.firsts, self.surface):
                own = (owner >= first) & (owner < first + len(marks))
                marks[owner[own] - first, side[own]] = True

    def _sides(self, owner: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """Which facet of its own element (k,) each facet (k, nodes) is."""
        result = np.zeros(len(owner), np.int64)
        for (kind, cells), first in zip(self.mesh.local.blocks, self.firsts):
            own = np.flatnonzero((owner >= first) & (owner < first + len(cells)))
            for number, facet in enumerate(ELEMENTS[kind].facets):
                if len(facet) == nodes.shape[1]:
                    same = (cells[owner[own] - first][:, facet] == nodes[own]).all(axis=1)
                    result[own[same]] = number
        return result

    def inside(self, places: np.ndarray, margin: float) -> int:
        """How many places (n, d) of all ranks, counted on the ranks that look for them, are in the elements, farther
        from their common surface than a margin [m]. Collective."""
        places, _, blocks = self._together(places, {}, margin)
        found, near = np.zeros(len(places), bool), np.zeros(len(places), bool)
        for _, _, place, distance, outer in _distances(blocks, places, margin):
            within = (distance >= -margin).all(axis=1)
            found[place[within]] = True
            near[place[within & (outer & (distance <= margin)).any(axis=1)]] = True
        return int((found & ~near).sum())

    def within_itself(self) -> tuple[int, np.ndarray | None]:
        """How many facets of the surface have a place in an element that is not their own, and the first such place.
        Collective.

        How often space is covered changes at the surface alone, so elements that lie in one another nowhere along it
        do so nowhere.
        """
        places, owner, facet = self._below_surface()
        places, of, blocks = self._together(places, {"owner": owner, "facet": facet}, 0.0)
        wrong = np.zeros(len(places), bool)
        for block, own, place, distance, _ in _distances(blocks, places, 0.0):
            other = of["owner"][place] != block.number[own]
            size = largest(np.ptp(block.corners[own[other]], axis=1))
            wrong[place[other][-largest(-distance[other]) > 1e-6 * size]] = True
        return self._counted(wrong, of["facet"], places)

    def hanging_nodes(self, length: float) -> tuple[int, np.ndarray | None]:
        """How many nodes of the surface lie on facets or edges of elements that do not have them, and the place (d,)
        [m] of the first; length [m]: of short edges, the same on all ranks. Collective."""
        local = self.mesh.local
        rows = np.unique(np.concatenate([np.zeros(0, np.int64), *(nodes.ravel() for _, nodes, _ in self.facets)]))
        margin = _ROUNDING * length
        places, of, blocks = self._together(local.points[rows], {"node": local.nodes[rows]}, margin)
        wrong = np.zeros(len(places), bool)
        for block, own, place, distance, _ in _distances(blocks, places, margin):
            near = np.flatnonzero((distance >= -margin).all(axis=1))
            corners, at = block.corners[own[near]], places[place[near]]
            nearest = np.sqrt(((corners - at[:, None]) ** 2).sum(axis=2).min(axis=1))
            wrong[place[near[nearest > margin]]] = True
        return self._counted(wrong, of["node"], places)

    def _counted(self, wrong: np.ndarray, number: np.ndarray, places: np.ndarray) -> tuple[int, np.ndarray | None]:
        """How many different numbers (n,) of all ranks are wrong, and the place of the least. Collective."""
        if not self.comm.allreduce(int(wrong.sum())):
            return 0, None
        # once each, by the rank that keeps the number
        keeper = number[wrong] % self.comm.size
        different = np.unique(migrate(self.comm, keeper, {"number": number[wrong]})["number"])
        first = int(np.flatnonzero(wrong)[np.argmin(number[wrong])]) if wrong.any() else -1
        least = int(number[first]) if wrong.any() else np.iinfo(np.int64).max
        place = places[first] if wrong.any() else np.full(places.shape[1], np.inf)
        return self.comm.allreduce(len(different)), first_place(self.comm, least, place)

    def _below_surface(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places just below the corners and the middle of all facets, the elements that own these, and a number for
        each facet of the mesh."""
        places, owners, numbers = [], [], []
        points, numbers_of = self.mesh.local.points, self.mesh.local.numbers
        for (owner, nodes, _), side in zip(self.facets, self.sides):
            corners = points[nodes]
            middle = corners.mean(axis=1)[:, None]
            chosen = np.concatenate([corners + _FROM_CORNER * (middle - corners), middle], axis=1)
            places.append((chosen + _BELOW * (self._middles(owner)[:, None] - chosen)).reshape(-1, corners.shape[2]))
            owners.append(np.repeat(numbers_of[owner], chosen.shape[1]))
            # an element has 6 facets at most
            numbers.append(np.repeat(6 * numbers_of[owner] + side, chosen.shape[1]))
        return np.concatenate(places), np.concatenate(owners), np.concatenate(numbers)

    def _middles(self, elements: np.ndarray) -> np.ndarray:
        """Means of the nodes (k, d) [m] of own elements (k,)."""
        points = self.mesh.local.points
        result = np.empty((len(elements), points.shape[1]))
        for (_, cells), first in zip(self.mesh.local.blocks, self.firsts):
            own = (elements >= first) & (elements < first + len(cells))
            result[own] = points[cells[elements[own] - first]].mean(axis=1)
        return result

    def _together(
        self, places: np.ndarray, values: dict[str, np.ndarray], margin: float
    ) -> tuple[np.ndarray, dict[str, np.ndarray], list[_Block]]:
        """Some of all ranks' places (n, d) with their values, and all elements whose box, wider by a margin [m], may
        have one of them."""
        lower, upper = self.lower - margin, self.upper + margin
        chosen = _may_have(self.comm, lower, upper, places)
        tree = None
        if self.comm.size > 1:
            _, tree = cut_points(self.comm, places)
            moved = migrate(self.comm, tree.owners(keys_of(places)), {"places": places, **values})
            places, values = moved.pop("places"), moved
        blocks = []
        for (kind, cells), first, surface in zip(self.mesh.local.blocks, self.firsts, self.surface):
            own = np.flatnonzero(chosen[first : first + len(cells)])
            rank = None
            if tree is not None:
                low, high = (keys_of(bound[first + own]) for bound in (lower, upper))
                pairs = tree.overlapping(low, high)
                own, rank = own[pairs[:, 0]], pairs[:, 1]
            arrays = {
                "corners": self.mesh.local.points[cells[own]],
                "number": self.mesh.local.numbers[first + own],
                "surface": surface[own],
            }
            blocks.append(_Block(kind, **(arrays if rank is None else migrate(self.comm, rank, arrays))))
        return places, values, blocks


def _pairs(lower: np.ndarray, upper: np.ndarray, places: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """(numbers of places, numbers of boxes lower .. upper) of which the box has the place; found on a grid."""
    if not (len(places) and len(lower)):
        return
    extent = upper - lower
    size = max(_CELL * float(extent.mean()), float(extent.max()) / 50.0)
    origin = lower.min(axis=0)
    first = np.floor((lower - origin) / size).astype(np.int64)
    count = np.floor((upper - origin) / size).astype(np.int64) - first + 1
    shape = (first + count).max(axis=0)
    repeat, place_in_box = _expanded(count.prod(axis=1))
    key, stride = np.zeros(len(repeat), np.int64), np.ones(len(repeat), np.int64)
    for i in range(places.shape[1]):
        key = key * shape[i] + first[repeat, i] + place_in_box // stride % count[repeat, i]
        stride *= count[repeat, i]
    order = np.argsort(key, kind="stable")
    key, holder = key[order], repeat[order]
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
    blocks: list[_Block], places: np.ndarray, margin: float
) -> Iterator[tuple[_Block, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """For the simplices of elements whose box, wider by a margin [m], has a place: the block, the elements' rows in it,
    numbers of places, distances (k, d + 1) [m] above the simplices' facets, and which of those are of the surface."""
    for block in blocks:
        facets = ELEMENTS[block.kind].facets
        for place, own in _pairs(block.corners.min(axis=1) - margin, block.corners.max(axis=1) + margin, places):
            for corners in _SIMPLICES[block.kind] if len(own) else ():
                nodes = block.corners[own][:, corners]
                outer = np.zeros((len(nodes), len(corners)), bool)
                for i, left_out in enumerate(corners):
                    rest = set(corners) - {left_out}
                    for number, facet in enumerate(facets):
                        if rest <= set(facet):
                            outer[:, i] = block.surface[own, number]
                yield block, own, place, _above_facets(nodes, places[place]), outer


def _over_nodes(bound: np.ufunc, points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The minimum or maximum (elements, d) [m] of the nodes of each element."""
    result = points[cells[:, 0]]
    for nodes in cells.T[1:]:
        bound(result, points[nodes], out=result)
    return result


def _may_have(comm: Any, lower: np.ndarray, upper: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Which boxes (n,) may have any of all ranks' places, by the numbers of places that cells of a grid have, summed
    up. Collective."""
    d = places.shape[1]
    cells, bounds = _COUNTED[d], np.concatenate([places, np.full((1, d), np.inf)])
    origin, top = np.empty(d), np.empty(d)
    comm.Allreduce(bounds.min(axis=0), origin, MPI.MIN)
    bounds[-1] = -np.inf
    comm.Allreduce(bounds.max(axis=0), top, MPI.MAX)
    if not (origin <= top).all():
        return np.zeros(len(lower), bool)
    size = np.maximum(top - origin, 1e-300) / cells
    index = np.minimum((places - origin) / size, cells - 1).astype(np.int64)
    flat = np.ravel_multi_index(tuple(index.T), (cells,) * d)
    counts = np.bincount(flat, minlength=cells**d)
    if comm.size > 1:
        comm.Allreduce(MPI.IN_PLACE, counts)
    table = np.pad(counts.reshape((cells,) * d), (1, 0))
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
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
