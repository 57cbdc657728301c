"""Contact candidates of a rank: its particles near other bodies, their ghosts on other ranks, and who is near whom."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import Halo
from decomposition.pair_search import ClosePairs
from parsolid.contact.body_pairs import BodyPairs, reflections, shares_of
from parsolid.contact.broad_phase import BroadPhase
from parsolid.contact.forces import Candidates, Pairs, may_press
from parsolid.contact.time_step import SEEN
from parsolid.kernels import kernel
from parsolid.methods.protocol import ParticleSystem

_HAIR = 1.0 + 1e-9


@kernel
def directed(start, neighbour, owned, outer, ghost, pair, reverse, particle):
    """Both directions of neighbours, owned and with ghosts, of which one's body pair is the reverse of the other's:
    starts, neighbours; pair, particle (n,): of each candidate, which is never a neighbour of its own particle."""
    count = np.zeros(owned + 1, np.int64)
    result = np.empty(0, np.int32)
    at = np.zeros(owned, np.int64)
    for turn in range(2):
        if turn:
            for a in range(owned):
                count[a + 1] += count[a]
                at[a] = count[a]
            result = np.empty(count[owned], np.int32)
        for a in range(owned):
            for k in range(start[a], start[a + 1]):
                b = neighbour[k]
                if pair[b] == reverse[pair[a]] and particle[a] != particle[b]:
                    if turn:
                        result[at[a]], result[at[b]] = b, a
                        at[a] += 1
                        at[b] += 1
                    else:
                        count[a + 1] += 1
                        count[b + 1] += 1
            for k in range(outer[a], outer[a + 1]):
                b = ghost[k]
                if pair[b] == reverse[pair[a]] and particle[a] != particle[b]:
                    if turn:
                        result[at[a]] = b
                        at[a] += 1
                    else:
                        count[a + 1] += 1
    return count, result


@kernel
def sort_rows(start, neighbour, code, key):
    """Order each row by the neighbours' keys, then by the codes of their images."""
    for a in range(len(start) - 1):
        for k in range(start[a] + 1, start[a + 1]):
            b, c = neighbour[k], code[k]
            m = k
            while m > start[a] and (
                key[neighbour[m - 1]] > key[b] or (key[neighbour[m - 1]] == key[b] and code[m - 1] > c)
            ):
                neighbour[m], code[m] = neighbour[m - 1], code[m - 1]
                m -= 1
            neighbour[m], code[m] = b, c


class Segment(NamedTuple):
    """Rows of a system's particles that are candidates first..last-1, all of one body pair."""

    system: int
    pair: int
    rows: np.ndarray
    first: int
    last: int


# constants of candidates from segments and whole volumes, in the order of `forces.Candidates` from threshold on
Constants = Callable[[list[Segment], np.ndarray, np.ndarray], list[np.ndarray]]


class Search:
    """Candidates of one rank: segments, the halo of their ghosts, and pairs.

    points, pairs: see `forces`; owned: how many candidates are this rank's own.
    """

    def __init__(self, comm: Any, body_pairs: BodyPairs, systems: list[ParticleSystem]) -> None:
        self.comm, self.body_pairs, self.systems = comm, body_pairs, systems
        self._search = ClosePairs()

    def build(
        self, boxes: BroadPhase, excluded: Callable[..., np.ndarray] | None, constants: Constants, prune: bool
    ) -> None:
        """Candidates and pairs in the present places; collective.

        excluded: which pairs of candidates of one body do not touch although they are near, see `within`. prune: leave
        out candidates that press on nothing and on which nothing presses, as long as the lists hold.
        """
        reaches = self.body_pairs.reach + boxes.beyond
        self.half = 0.5 * reaches
        self.segments = self._segments(boxes)
        self.owned = self.segments[-1].last if self.segments else 0
        pair = np.concatenate([np.full(one.last - one.first, one.pair) for one in self.segments] or [np.zeros(0, int)])
        place, share = self.gathered("position"), self._shares()
        reach = float(reaches[boxes.near].max(initial=0.0))
        halo = Halo(self.comm, place, reach * _HAIR if reach > 0.0 else 1.0)
        d, volume = place.shape[1], self.gathered("volume") / share
        of_law: Any = constants(self.segments, volume, share)
        skin, identifier = self.body_pairs.skin[pair], self.gathered("identifier").astype(np.int64)
        rows = np.zeros((self.owned + halo.ghosts, 4))
        rows[: self.owned, :d], rows[: self.owned, 3] = place, volume
        halo.forward(rows).now()
        pair, particle = halo.with_ghosts(pair.astype(np.int64)), halo.with_ghosts(identifier)
        start, neighbour = self._neighbours(np.ascontiguousarray(rows[:, :d]), pair, particle)
        if excluded is not None:
            reference = halo.with_ghosts(self.gathered("reference_position"))
            row = np.repeat(np.arange(self.owned), np.diff(start))
            start, neighbour = _kept(start, neighbour, ~excluded(pair, row, neighbour, reference, particle))
        start, neighbour, image, mirrors = self._with_images(start, neighbour, rows[:, :d], pair)
        active = np.ones(self.owned, np.int64)
        points = Candidates._make([rows, np.zeros((len(rows), 3)), share, *of_law, d])
        pairs = Pairs(start, neighbour, image if mirrors is not None else None, mirrors, active)
        if prune:
            active = may_press(points, pairs, skin, SEEN)
        self._prune(halo, points, pairs._replace(active=halo.with_ghosts(active) > 0), image, particle)

    def _neighbours(self, place: np.ndarray, pair: np.ndarray, particle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Near candidates of the owned ones: starts, neighbours."""
        found: Any = (np.zeros(1, np.int64), np.empty(0, np.int32)) * 2
        if self.owned:
            found = self._search.find(place, np.ascontiguousarray(self.half[pair]), self.owned)
        return directed(*found[:2], self.owned, *found[2:], pair, self.body_pairs.reverse, particle)

    def _prune(self, halo: Halo, points: Candidates, pairs: Pairs, image: np.ndarray, particle: np.ndarray) -> None:
        """Keep the pairs of which one may press; collective. pairs.active, particle: with ghosts."""
        row = np.repeat(np.arange(self.owned), np.diff(pairs.start))
        keep = pairs.active[row] | pairs.active[pairs.neighbour]
        start, neighbour = _kept(pairs.start, pairs.neighbour, keep)
        used = np.zeros(len(particle), bool)
        used[row[keep]] = used[neighbour] = True
        number = (np.cumsum(used) - 1).astype(np.int32)
        mine = used[: self.owned]
        self.halo = halo.subset(used[self.owned :], mine)
        neighbour, image, start = number[neighbour], image[keep], start[np.append(mine, True)]
        sort_rows(start, neighbour, image, particle[used])
        of_owned: Any = [values[mine] for values in points[2:-1]]
        self.points = Candidates._make([points.rows[used], points.moved[used], *of_owned, points.dimension])
        active = pairs.active[: self.owned][mine].astype(np.int64)
        self.pairs = Pairs(start, neighbour, None if pairs.mirrors is None else image, pairs.mirrors, active)
        before = np.concatenate(([0], np.cumsum(mine)))
        ends = [(one, int(before[one.first]), int(before[one.last])) for one in self.segments]
        self.segments = [
            one._replace(rows=one.rows[mine[one.first : one.last]], first=first, last=last)
            for one, first, last in ends
            if last > first
        ]
        self.owned = int(mine.sum())

    def _shares(self) -> np.ndarray:
        pieces = [
            shares_of(self.systems[one.system], one.rows, self.body_pairs.pairs[one.pair]) for one in self.segments
        ]
        return np.concatenate(pieces or [np.zeros(0)])

    def leave_out_deleted(self) -> None:
        """Let owned candidates that were deleted feel nothing more and be felt no more."""
        for one in self.segments:
            particles = self.systems[one.system].particles
            if "deleted_mass" in particles:
                gone = one.first + np.flatnonzero(particles.owned_rows("deleted_mass")[one.rows] > 0.0)
                self.points.rows[gone, 3], self.pairs.active[gone] = 0.0, 0

    def _segments(self, boxes: BroadPhase) -> list[Segment]:
        """Particles near other bodies, but those that were deleted before the last forces were found."""
        result: list[Segment] = []
        first = 0
        bodies = [_rows_of(system) for system in self.systems]
        for number in np.flatnonzero(boxes.near):
            pair = self.body_pairs.pairs[number]
            for index, system in enumerate(self.systems):
                if pair.own not in system.bodies:
                    continue
                rows = bodies[index][system.bodies.index(pair.own)]
                if pair.own != pair.other:
                    place = system.particles.owned_rows("position")[rows]
                    out = np.maximum(boxes.lower[pair.other] - place, place - boxes.upper[pair.other])
                    gap = np.maximum(out, 0.0)
                    rows = rows[(gap * gap).sum(axis=1) < (2.0 * self.half[number]) ** 2]
                if "deleted_mass" in system.particles:
                    force, gone = (
                        system.particles.owned_rows(name)[rows] for name in ("contact_force", "deleted_mass")
                    )
                    rows = rows[(gone <= 0.0) | force.any(axis=1)]
                if len(rows):
                    result.append(Segment(index, int(number), rows, first, first + len(rows)))
                    first += len(rows)
        return result

    def gathered(self, name: str) -> np.ndarray:
        """A field of the particles of the owned candidates."""
        pieces = [self.systems[one.system].particles.owned_rows(name)[one.rows] for one in self.segments]
        if pieces:
            return np.ascontiguousarray(np.concatenate(pieces))
        like = self.systems[0].particles.owned_rows(name)
        return np.zeros((0, *like.shape[1:]), like.dtype)

    def _with_images(self, start: Any, neighbour: Any, place: np.ndarray, pair: np.ndarray) -> tuple[Any, ...]:
        """Lists with the images of neighbours behind the symmetry planes that both bodies have: starts, neighbours,
        numbers of images, and the mirrors of `forces.Pairs`."""
        image, planes = np.zeros(len(neighbour), np.int8), [one.planes for one in self.body_pairs.pairs]
        if not any(planes):
            return start, neighbour, image, None
        d = place.shape[1]
        tables: list[tuple[np.ndarray, np.ndarray]] = [(np.ones(d), np.zeros(d))]
        row = np.repeat(np.arange(self.owned), np.diff(start))
        rows, neighbours, images = [row], [neighbour], [image]
        for number, shared in enumerate(planes):
            mine = pair[row] == number
            if not mine.any():
                continue
            limit = 2.0 * self.half[number]
            for R, T in reflections(shared, d):
                mirrored = place[neighbour[mine]] * R + T
                gap = np.linalg.norm(place[row[mine]] - mirrored, axis=1)
                # a particle on a plane is its own image there
                off = (np.abs(mirrored - place[neighbour[mine]]) > 1e-6 * limit)[:, R < 0.0].all(axis=1)
                chosen = np.flatnonzero(mine)[(gap < limit) & off]
                rows.append(row[chosen])
                neighbours.append(neighbour[chosen])
                images.append(np.full(len(chosen), len(tables), np.int8))
                tables.append((R, T))
        mirrors = np.zeros((2, len(tables), 4))
        # of what lies beyond the dimension nothing changes
        mirrors[0] = 1.0
        mirrors[:, :, :d] = np.array(tables).swapaxes(0, 1)
        row, neighbour, image = (np.concatenate(pieces) for pieces in (rows, neighbours, images))
        order = np.argsort(row, kind="stable")
        start = np.concatenate(([0], np.cumsum(np.bincount(row, minlength=self.owned)))).astype(np.int64)
        return start, neighbour[order], image[order], mirrors


def _rows_of(system: ParticleSystem) -> list[np.ndarray]:
    """Rows of each body, rising."""
    body = system.particles.owned_rows("body")
    order = np.argsort(body, kind="stable")
    return np.split(order, np.searchsorted(body[order], np.arange(1, len(system.bodies))))


def _kept(start: np.ndarray, neighbour: np.ndarray, keep: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows with only some of their neighbours."""
    before = np.concatenate(([0], np.cumsum(keep)))
    return before[start].astype(np.int64), neighbour[keep]
