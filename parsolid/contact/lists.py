"""Entries of a rank's particles near other bodies, their ghosts on other ranks, and who is near whom."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import Halo
from decomposition.pair_search import ClosePairs
from parsolid.contact import passes
from parsolid.contact.boxes import Boxes
from parsolid.contact.list_kernels import directed, sort_rows
from parsolid.contact.sides import Sides, reflections, shares_of
from parsolid.methods.protocol import ParticleSystem

_HAIR = 1.0 + 1e-9
# of its threshold, what a particle sees of a body that it has met
SEEN = 0.5


class Segment(NamedTuple):
    """Rows of a system's particles that have entries first..last-1, all of one side."""

    system: int
    side: int
    rows: np.ndarray
    first: int
    last: int


class Entries:
    """Entries of one rank: segments, the halo of their ghosts, and lists; arrays with ghosts behind.

    volume (with ghosts) [m^3], share (of `sides.shares_of`), constants, lists: see `passes`.
    """

    def __init__(self, comm: Any, sides: Sides, systems: list[ParticleSystem]) -> None:
        self.comm, self.sides, self.systems = comm, sides, systems
        self._search = ClosePairs()
        self.reverse = np.array([side.reverse for side in sides.sides], np.int64)
        self.reach = np.array([side.reach for side in sides.sides])
        self.skin = np.array([side.skin for side in sides.sides])

    def build(
        self, boxes: Boxes, excluded: Callable[..., np.ndarray] | None, law: Callable[..., np.ndarray], prune: bool
    ) -> None:
        """Entries and lists in the present places; collective.

        excluded: which pairs of entries of one body, by side, owned row, neighbour and reference places with ghosts,
        do not touch although they are near. law: constants (owned, 5) of `passes` from the volumes (owned,) [m^3].
        prune: leave out entries that press on nothing and on which nothing presses, as long as the lists hold.
        """
        self.half = 0.5 * (self.reach + boxes.beyond)
        self.segments = self._segments(boxes)
        self.owned = self.segments[-1].last if self.segments else 0
        side = np.concatenate([np.full(one.last - one.first, one.side) for one in self.segments] or [np.zeros(0, int)])
        place, self.share = self.gathered("position"), self._shares()
        reach = float((2.0 * self.half[boxes.near]).max(initial=0.0))
        if not reach > 0.0:
            reach = 1.0
        halo = Halo(self.comm, place, reach * _HAIR)
        whole, volume = halo.with_ghosts(place), self.gathered("volume") / self.share
        self.constants = law(self.segments, volume)
        volume = halo.with_ghosts(volume)
        side = halo.with_ghosts(side.astype(np.int64))
        particle = halo.with_ghosts(self.gathered("identifier").astype(np.int64))
        if self.owned:
            found = self._search.find(whole, np.ascontiguousarray(self.half[side]), self.owned)
        else:
            found = (np.zeros(1, np.int64), np.empty(0, np.int32)) * 2
        start, neighbour = directed(*found[:2], self.owned, *found[2:], side, self.reverse, particle)
        if excluded is not None:
            reference = halo.with_ghosts(self.gathered("reference_position"))
            row = np.repeat(np.arange(self.owned), np.diff(start))
            start, neighbour = _kept(start, neighbour, ~excluded(side, row, neighbour, reference, particle))
        code = np.zeros(len(neighbour), np.int8)
        start, neighbour, code = self._with_images(start, neighbour, code, whole, side)
        lists = passes.Lists(start, neighbour, code if self.table is not None else None, self.table, None)
        matter = passes.Matter(whole, volume, self.share, self.constants)
        feels = np.ones(self.owned, np.int64)
        if prune:
            feels = passes.may_feel(self.owned, matter, lists, self.skin[side[: self.owned]], SEEN)
        self._prune(halo, start, neighbour, code, halo.with_ghosts(feels) > 0, volume, particle)

    def _prune(self, halo: Halo, start: Any, neighbour: Any, code: Any, feels: Any, volume: Any, particle: Any) -> None:
        """Keep the pairs of which one may press; collective. feels, volume, particle: with ghosts."""
        row = np.repeat(np.arange(self.owned), np.diff(start))
        keep = feels[row] | feels[neighbour]
        start, neighbour = _kept(start, neighbour, keep)
        used = np.zeros(len(feels), bool)
        used[row[keep]] = used[neighbour] = True
        number = (np.cumsum(used) - 1).astype(np.int32)
        mine = used[: self.owned]
        self.halo = halo.subset(used[self.owned :], mine)
        neighbour, code, start = number[neighbour], code[keep], start[np.append(mine, True)]
        sort_rows(start, neighbour, code, particle[used])
        self.volume, self.share, self.constants = volume[used], self.share[mine], self.constants[mine]
        lists = start, neighbour, code if self.table is not None else None, self.table
        self.lists = passes.Lists(*lists, feels[: self.owned][mine])
        self.segments = [
            one._replace(rows=one.rows[mine[one.first : one.last]], first=first, last=last)
            for one, first, last in (
                (one, int(mine[: one.first].sum()), int(mine[: one.last].sum())) for one in self.segments
            )
            if last > first
        ]
        self.owned = int(mine.sum())

    def _shares(self) -> np.ndarray:
        pieces = [shares_of(self.systems[one.system], one.rows, self.sides.sides[one.side]) for one in self.segments]
        return np.concatenate(pieces or [np.zeros(0)])

    def _segments(self, boxes: Boxes) -> list[Segment]:
        result: list[Segment] = []
        first = 0
        bodies = [_rows_of(system) for system in self.systems]
        for number in np.flatnonzero(boxes.near):
            side = self.sides.sides[number]
            for index, system in enumerate(self.systems):
                if side.own not in system.bodies:
                    continue
                rows = bodies[index][system.bodies.index(side.own)]
                if side.own != side.other:
                    place = system.particles.owned_rows("position")[rows]
                    out = np.maximum(boxes.lower[side.other] - place, place - boxes.upper[side.other])
                    gap = np.maximum(out, 0.0)
                    rows = rows[(gap * gap).sum(axis=1) < (2.0 * self.half[number]) ** 2]
                if len(rows):
                    result.append(Segment(index, int(number), rows, first, first + len(rows)))
                    first += len(rows)
        return result

    def gathered(self, name: str) -> np.ndarray:
        """A field of the particles of the owned entries."""
        pieces = [self.systems[one.system].particles.owned_rows(name)[one.rows] for one in self.segments]
        if pieces:
            return np.ascontiguousarray(np.concatenate(pieces))
        like = self.systems[0].particles.owned_rows(name)
        return np.zeros((0, *like.shape[1:]), like.dtype)

    def _with_images(self, start: Any, neighbour: Any, code: Any, place: np.ndarray, side: np.ndarray) -> Any:
        """Lists with the images of neighbours behind the symmetry planes that both bodies have."""
        planes = [one.planes for one in self.sides.sides]
        self.table: np.ndarray | None = None
        if not any(planes):
            return start, neighbour, code
        d = place.shape[1]
        tables: list[tuple[np.ndarray, np.ndarray]] = [(np.ones(d), np.zeros(d))]
        row = np.repeat(np.arange(self.owned), np.diff(start))
        rows, neighbours, codes = [row], [neighbour], [code]
        for number, shared in enumerate(planes):
            mine = side[row] == number
            if not mine.any():
                continue
            limit = 2.0 * self.half[number]
            for R, T in reflections(shared, d):
                image = place[neighbour[mine]] * R + T
                gap = np.linalg.norm(place[row[mine]] - image, axis=1)
                reflected = R < 0.0
                # a particle on a plane is its own image there
                off = (np.abs(image - place[neighbour[mine]]) > 1e-6 * limit)[:, reflected].all(axis=1)
                chosen = np.flatnonzero(mine)[(gap < limit) & off]
                rows.append(row[chosen])
                neighbours.append(neighbour[chosen])
                codes.append(np.full(len(chosen), len(tables), np.int8))
                tables.append((R, T))
        self.table = np.zeros((2, len(tables), 4))
        # of what lies beyond the dimension nothing changes
        self.table[0] = 1.0
        self.table[:, :, :d] = np.array(tables).swapaxes(0, 1)
        row, neighbour, code = (np.concatenate(pieces) for pieces in (rows, neighbours, codes))
        order = np.argsort(row, kind="stable")
        start = np.concatenate(([0], np.cumsum(np.bincount(row, minlength=self.owned)))).astype(np.int64)
        return start, neighbour[order], code[order]


def _rows_of(system: ParticleSystem) -> list[np.ndarray]:
    """Rows of each body, rising."""
    body = system.particles.owned_rows("body")
    order = np.argsort(body, kind="stable")
    return np.split(order, np.searchsorted(body[order], np.arange(1, len(system.bodies))))


def _kept(start: np.ndarray, neighbour: np.ndarray, keep: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows with only some of their neighbours."""
    before = np.concatenate(([0], np.cumsum(keep)))
    return before[start].astype(np.int64), neighbour[keep]
