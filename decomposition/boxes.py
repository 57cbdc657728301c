"""Boxes of lattice nodes on many ranks: cuts along lattice planes, which parts touch, and messages between them.

Every rank computes all cuts from the same few numbers, so that no rank asks another, as `bisection` would: parts are
boxes, too, which cuts between single points are not. A box is cut across its two slowest axes in memory only: nodes
along the fastest one stay together.
"""

from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from .plan import Messages
from .timer import COMMUNICATION


class BoxOfNodes(NamedTuple):
    """A box as cuts see it; d arrays or numbers by axis in memory, the slowest first.

    places: of the planes of nodes along each axis in space, d arrays (n,) [m]; axes: the axis in space of each memory
    axis; ends: the least number of planes of a part at each end of each memory axis; parts in between have two or more.
    """

    places: tuple[np.ndarray, ...]
    axes: tuple[int, ...]
    ends: tuple[tuple[int, int], ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Nodes along each memory axis."""
        return tuple(len(self.places[axis]) for axis in self.axes)


class _Part(NamedTuple):
    box: int
    lower: tuple[int, ...]
    upper: tuple[int, ...]

    @property
    def nodes(self) -> int:
        return int(np.prod(np.subtract(self.upper, self.lower)))


# planes of ghosts behind a cut: of one neighbour, so that parts between two cuts have as many at least
GHOST_PLANES = 2


def cut_boxes(boxes: list[BoxOfNodes], ranks: int) -> np.ndarray:
    """Parts (boxes, ranks, 2, d): first node of each rank's part along each memory axis and the one after its last, the
    same where a rank has no part.

    All boxes together are halved again and again across the axis in space along which they are longest, each at the
    lattice plane next to the cut; a part that is too thin goes to one side. The parts of the ranks have about the same
    number of nodes where boxes have enough planes.
    """
    result = np.zeros((len(boxes), ranks, 2, len(boxes[0].axes) if boxes else 0), np.int64)
    whole = [_Part(i, (0,) * len(box.axes), box.shape) for i, box in enumerate(boxes)]
    waiting = [(whole, 0, ranks)]
    while waiting:
        parts, first, last = waiting.pop()
        if last - first == 1:
            for part in parts:
                result[part.box, first] = part.lower, part.upper
        elif parts:
            middle = (first + last) // 2
            below, above = _halves(boxes, parts, (middle - first) / (last - first))
            waiting += [(below, first, middle), (above, middle, last)]
    return result


def _halves(boxes: list[BoxOfNodes], parts: list[_Part], share: float) -> tuple[list[_Part], list[_Part]]:
    """Parts on both sides of a cut, those below with about a share of all nodes: across the longest axis where that is
    fulfilled to a tenth, else across the best one."""
    total, found = sum(part.nodes for part in parts), []
    d = len(boxes[0].axes)
    bounds = np.array([[_bounds(boxes[part.box], part, axis) for axis in range(d)] for part in parts])
    extent = bounds[:, :, 1].max(axis=0) - bounds[:, :, 0].min(axis=0)
    for axis in [int(axis) for axis in np.argsort(-np.round(extent / extent.max(), 9), kind="stable")]:
        for place in _candidates(boxes, parts, axis, share * total):
            below, above = [], []
            for part in parts:
                box = boxes[part.box]
                k = box.axes.index(axis)
                planes = box.places[axis][part.lower[k] : part.upper[k]]
                cut = part.lower[k] + _allowed_cut(box, part, k, int(np.searchsorted(planes, place)))
                if cut > part.lower[k]:
                    below.append(part._replace(upper=(*part.upper[:k], cut, *part.upper[k + 1 :])))
                if cut < part.upper[k]:
                    above.append(part._replace(lower=(*part.lower[:k], cut, *part.lower[k + 1 :])))
            found.append((abs(sum(part.nodes for part in below) / total - share), (below, above)))
        best = min(found, key=lambda one: one[0])
        if best[0] <= 0.1 * share:
            break
    return best[1]


def _bounds(box: BoxOfNodes, part: _Part, axis: int) -> tuple[float, float]:
    k = box.axes.index(axis)
    return box.places[axis][part.lower[k]], box.places[axis][part.upper[k] - 1]


def _candidates(boxes: list[BoxOfNodes], parts: list[_Part], axis: int, wanted: float) -> np.ndarray:
    """Places beside planes of nodes near the one below which there are as many nodes as wanted."""
    places, nodes = [], []
    for part in parts:
        k = boxes[part.box].axes.index(axis)
        planes = boxes[part.box].places[axis][part.lower[k] : part.upper[k]]
        places.append(planes)
        nodes.append(np.full(len(planes), part.nodes / len(planes)))
    every, counts = np.concatenate(places), np.concatenate(nodes)
    different, which = np.unique(every, return_inverse=True)
    below = np.cumsum(np.bincount(which, counts))
    near = int(np.searchsorted(below, wanted * (1.0 - 1e-12)))
    between = 0.5 * (different[1:] + different[:-1])
    return between[max(0, near - 4) : near + 5] if len(between) else different


def _allowed_cut(box: BoxOfNodes, part: _Part, k: int, wanted: int) -> int:
    """Planes below the cut of a part next to a wanted number; all or none where it cannot be cut."""
    count = part.upper[k] - part.lower[k]
    least = box.ends[k][0] if part.lower[k] == 0 else GHOST_PLANES
    most = count - (box.ends[k][1] if part.upper[k] == box.shape[k] else GHOST_PLANES)
    # the fastest axis of all, which is the last one in space, is not cut
    if wanted <= 0 or (k < 2 and least <= most and wanted < least and 2 * wanted < least):
        return 0
    if wanted >= count or (k < 2 and least <= most and wanted > most and 2 * (count - wanted) < count - most):
        return count
    if k > 1 or least > most:
        return 0 if 2 * wanted < count else count
    return min(max(wanted, least), most)


def owners(parts: np.ndarray, axes: tuple[int, ...], index: list[np.ndarray]) -> np.ndarray:
    """Rank (n,) int32 of nodes of a box; parts (ranks, 2, d) of `cut_boxes`; index: d arrays (n,) by axis in space."""
    owner = np.full(len(index[0]), -1, np.int32)
    for rank, (lower, upper) in enumerate(parts):
        if np.all(lower < upper):
            inside = np.ones(len(owner), bool)
            for k, axis in enumerate(axes):
                inside &= (index[axis] >= lower[k]) & (index[axis] < upper[k])
            owner[inside] = rank
    return owner


class Link(NamedTuple):
    """Where this rank's part of a box touches another rank's across a cut: planes normal to a memory axis.

    inside, outside: slices (planes, nodes) of the box arrays of own nodes beside the cut and of ghosts behind it, by
    their depth in planes.
    """

    rank: int
    axis: int
    inside: dict[int, tuple[slice, slice]]
    outside: dict[int, tuple[slice, slice]]


def with_ghosts(parts: np.ndarray, rank: int, shape: tuple[int, ...]) -> np.ndarray:
    """First nodes (d,) of a rank's box arrays and those after the last (2, d): two ghosts behind each cut."""
    lower, upper = parts[rank].copy()
    for k in range(2):
        lower[k] -= GHOST_PLANES if lower[k] > 0 else 0
        upper[k] += GHOST_PLANES if upper[k] < shape[k] else 0
    return np.array([lower, upper])


def links_of(parts: np.ndarray, rank: int, shape: tuple[int, ...]) -> list[Link]:
    """Links of a rank's part of a box with those of other ranks; parts (ranks, 2, d) of `cut_boxes`."""
    lower, upper = parts[rank]
    if not np.all(lower < upper):
        return []
    base, row = with_ghosts(parts, rank, shape)[0], shape[2] if len(shape) > 2 else 1
    found = []
    for axis in (0, 1):
        across = 1 - axis
        filled = (parts[:, 0] < parts[:, 1]).all(axis=1)
        meet = filled & (
            np.maximum(parts[:, 0, across], lower[across]) < np.minimum(parts[:, 1, across], upper[across])
        )
        for other in np.flatnonzero(meet & ((parts[:, 1, axis] == lower[axis]) | (parts[:, 0, axis] == upper[axis]))):
            low, high = np.maximum(parts[other, 0], lower), np.minimum(parts[other, 1], upper)
            above = parts[other, 0, axis] == upper[axis]
            inside, outside = {}, {}
            for depth in (1, 2):
                cut = upper[axis] if above else lower[axis]
                spans = {axis: (cut - depth, cut) if above else (cut, cut + depth), across: (low[across], high[across])}
                inside[depth] = _slices(spans, base, row)
                spans[axis] = (cut, cut + depth) if above else (cut - depth, cut)
                outside[depth] = _slices(spans, base, row)
            found.append(Link(int(other), axis, inside, outside))
    return found


def _slices(spans: dict[int, tuple[int, int]], base: np.ndarray, row: int) -> tuple[slice, slice]:
    planes, rows = (slice(int(spans[k][0] - base[k]), int(spans[k][1] - base[k])) for k in (0, 1))
    return planes, slice(rows.start * row, rows.stop * row)


class Transfer(NamedTuple):
    """Views of box arrays of the same shape: what another rank is sent and what it sends."""

    rank: int
    sent: np.ndarray
    received: np.ndarray


class GhostExchange:
    """One message to and from each neighbour with all that it is sent at once; made once, sent in every step.

    Transfers of a pair of ranks stand in the same order on both.
    """

    def __init__(self, comm: MPI.Comm, transfers: list[Transfer]) -> None:
        """Exchanges are started and finished in the same order on all ranks."""
        ranks = sorted({transfer.rank for transfer in transfers})
        pieces = [[transfer for transfer in transfers if transfer.rank == rank] for rank in ranks]
        sent, received = (
            [sum(getattr(one, way).size for one in each) for each in pieces] for way in Transfer._fields[1:]
        )
        self.messages = Messages(comm, ranks, sent, received)
        self.bytes_sent = self.messages.outgoing.nbytes
        together = [one for each in pieces for one in each]
        self._sent = _places(self.messages.outgoing, [one.sent for one in together])
        self._received = _places(self.messages.incoming, [one.received for one in together])

    def start(self) -> None:
        """Send what this rank's nodes hold now."""
        if not self.messages.silent:
            with COMMUNICATION:
                self.messages.receive()
                for place, view in self._sent:
                    place[...] = view
                self.messages.send()

    def finish(self) -> None:
        """Wait for the ghosts."""
        if not self.messages.silent:
            with COMMUNICATION:
                self.messages.wait()
                for place, view in self._received:
                    view[...] = place

    def free(self) -> None:
        """Give the requests back to MPI."""
        self.messages.free()


def _places(buffer: np.ndarray, views: list[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Views, and where they stand in a buffer, one after the other, as arrays of their shapes."""
    ends = np.cumsum([0, *(view.size for view in views)])
    return [(buffer[a:b].reshape(view.shape), view) for a, b, view in zip(ends, ends[1:], views)]
