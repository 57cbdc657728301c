"""Contact candidates of a rank: its particles near other bodies, their ghosts on other ranks, and pairs of them."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import REACH_MARGIN, Halo
from decomposition.pair_search import ClosePairs
from parsolid.contact.bodies import ContactLaw, reflections, shares_of
from parsolid.contact.broad_phase import BroadPhase
from parsolid.contact.forces import Candidates, Pairs, may_press
from parsolid.contact.self_contact import SelfContact
from parsolid.contact.time_step import SEEN
from parsolid.kernels import kernel
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.generated import cell_volumes


@kernel
def directed(start, neighbour, owned, outer, ghost, pair, reverse, particle):
    """Starts and neighbours of owned candidates, both ways round, from pairs among the owned ones (start, neighbour)
    and with ghosts (outer, ghost). Candidates are neighbours where the body pair of one is the reverse of the other's.

    pair, particle (n,): body pair and particle of each candidate; a candidate is no neighbour of its own particle.
    """
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
    """Sort each row of neighbours by their keys, then by the codes of their images."""
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


@kernel
def near_boxes(place, pair, lower, upper, reach):
    """Which places (n, d) [m] are within reach (pairs,) [m] of the box lower, upper (pairs, d) of their pair (n,)."""
    result = np.zeros(len(place), np.bool_)
    for a in range(len(place)):
        p, square = pair[a], 0.0
        for i in range(place.shape[1]):
            square += max(lower[p, i] - place[a, i], place[a, i] - upper[p, i], 0.0) ** 2
        result[a] = square < reach[p] * reach[p]
    return result


class Segment(NamedTuple):
    """The candidates of one system: one for each body that a particle may touch.

    system: its number; rows, pair (k,): particle and body pair of each; here: where they are among the owned ones.
    """

    system: int
    rows: np.ndarray
    pair: np.ndarray
    here: slice


# (volumes, shares) of candidates -> their fields of `forces.Candidates` from threshold to norm
Constants = Callable[[np.ndarray, np.ndarray], list[np.ndarray]]


class Search:
    """Candidates of one rank.

    segments: by system; halo: of their ghosts; points, pairs: see `forces`; owned: number of this rank's own; pair
    (owned,): body pairs, see `BroadPhase`; half (body pairs,) [m]: half the reach of the lists.
    """

    def __init__(self, comm: Any, boxes: BroadPhase, systems: list[ParticleSystem]) -> None:
        self.comm, self.boxes, self.systems = comm, boxes, systems
        self._search = ClosePairs()

    def build(self, self_contact: SelfContact, constants: Constants, prune: bool) -> None:
        """Candidates and pairs at the present positions; collective. prune: leave out candidates that cannot be in
        contact while the lists are valid."""
        boxes = self.boxes
        reaches = boxes.reach + boxes.beyond
        self.half = 0.5 * reaches
        self.segments = self._segments()
        self.owned = self.segments[-1].here.stop if self.segments else 0
        self.pair = np.concatenate([np.zeros(0, np.int64), *(segment.pair for segment in self.segments)])
        place, share = self.gathered("position"), np.ones(self.owned)
        for law, here, segment in self.of_laws():
            rows_of_law = segment.rows[here - segment.here.start]
            share[here] = shares_of(self.systems[segment.system], rows_of_law, law)
        reach = float(reaches[boxes.near].max(initial=0.0))
        halo = Halo(self.comm, place, reach * REACH_MARGIN if reach > 0.0 else 1.0)
        cells = [cell_volumes(self.systems[segment.system].particles)[segment.rows] for segment in self.segments]
        d, volume = place.shape[1], np.concatenate([np.zeros(0), *cells]) / share
        of_law: Any = constants(volume, share)
        skin, identifier = boxes.skin[self.pair], self.gathered("identifier").astype(np.int64)
        rows = np.zeros((self.owned + halo.ghosts, 4))
        rows[: self.owned, :d], rows[: self.owned, 3] = place, volume
        halo.forward(rows).now()
        pair, particle = halo.with_ghosts(self.pair), halo.with_ghosts(identifier)
        found: Any = (np.zeros(1, np.int64), np.empty(0, np.int32)) * 2
        if self.owned:
            everywhere = np.ascontiguousarray(rows[:, :d])
            found = self._search.find(everywhere, np.ascontiguousarray(self.half[pair]), self.owned)
        start, neighbour = directed(*found[:2], self.owned, *found[2:], pair, boxes.reverse, particle)
        if any(self_contact.touching):
            reference = halo.with_ghosts(self.gathered("reference_position"))
            row = np.repeat(np.arange(self.owned), np.diff(start))
            start, neighbour = _kept(
                start, neighbour, ~self_contact.excluded(boxes, pair, row, neighbour, reference, particle)
            )
        start, neighbour, image, mirrors = self._with_images(start, neighbour, rows[:, :d], pair)
        active = np.ones(self.owned, np.int64)
        points = Candidates._make([rows, np.zeros((len(rows), 3)), share, *of_law, d])
        pairs = Pairs(start, neighbour, image if mirrors is not None else None, mirrors, active)
        if prune:
            active = may_press(points, pairs, skin, SEEN)
        self._prune(halo, points, pairs._replace(active=halo.with_ghosts(active) > 0), image, particle)

    def _prune(self, halo: Halo, points: Candidates, pairs: Pairs, image: np.ndarray, particle: np.ndarray) -> None:
        """Keep pairs of which at least one candidate is active; collective. pairs.active, particle: with ghosts."""
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
        segments, self.segments = self.segments, []
        for system, rows, of_bodies, here in segments:
            keep, here = mine[here], slice(int(before[here.start]), int(before[here.stop]))
            if keep.any():
                self.segments.append(Segment(system, rows[keep], of_bodies[keep], here))
        self.owned, self.pair = int(mine.sum()), self.pair[mine]

    def of_laws(self) -> Iterator[tuple[ContactLaw, np.ndarray, Segment]]:
        """Of each segment the laws with the candidates (k,) to which they apply."""
        for segment in self.segments:
            number = self.boxes.law[segment.pair]
            for k in np.unique(number):
                yield self.boxes.contact.laws[k][1], segment.here.start + np.flatnonzero(number == k), segment

    def leave_out_deleted(self) -> None:
        """Take owned candidates of deleted particles out of contact."""
        for segment in self.segments:
            particles = self.systems[segment.system].particles
            if "deleted_mass" in particles:
                gone = segment.here.start + np.flatnonzero(particles.owned_rows("deleted_mass")[segment.rows] > 0.0)
                self.points.rows[gone, 3], self.pairs.active[gone] = 0.0, 0

    def _segments(self) -> list[Segment]:
        """Particles near other bodies, without those deleted before the last evaluation of forces."""
        result: list[Segment] = []
        boxes, near, first = self.boxes, np.flatnonzero(self.boxes.near), 0
        for index, system in enumerate(self.systems):
            of, local = system.particles.owned_rows, np.full(boxes.bodies, -1)
            local[list(system.bodies)] = np.arange(len(system.bodies))
            mine = near[local[boxes.own[near]] >= 0]
            order = np.argsort(of("body"), kind="stable")
            ends = np.searchsorted(of("body")[order], np.arange(len(system.bodies) + 1))
            # particles of the own body of each pair, pair after pair
            begin, count = ends[local[boxes.own[mine]]], np.diff(ends)[local[boxes.own[mine]]]
            pair = np.repeat(mine, count)
            rows = order[np.arange(len(pair)) + np.repeat(begin - np.cumsum(count) + count, count)]
            box = boxes.lower[boxes.other], boxes.upper[boxes.other]
            keep = near_boxes(of("position")[rows], pair, *box, 2.0 * self.half) | (boxes.own == boxes.other)[pair]
            if "deleted_mass" in system.particles:
                keep &= (of("deleted_mass")[rows] <= 0.0) | of("contact_force")[rows].any(axis=1)
            if keep.any():
                here = slice(first, first + int(keep.sum()))
                result.append(Segment(index, rows[keep], pair[keep], here))
                first = here.stop
        return result

    def gathered(self, name: str) -> np.ndarray:
        """A field of the particles of the owned candidates."""
        pieces = [self.systems[segment.system].particles.owned_rows(name)[segment.rows] for segment in self.segments]
        return np.ascontiguousarray(np.concatenate(pieces or [self.systems[0].particles.owned_rows(name)[:0]]))

    def _with_images(self, start: Any, neighbour: Any, place: np.ndarray, pair: np.ndarray) -> tuple[Any, ...]:
        """Lists with the images of neighbours behind the symmetry planes that both bodies have: start, neighbour, image
        and mirrors of `forces.Pairs`."""
        image, d = np.zeros(len(neighbour), np.int8), place.shape[1]
        laws = [law for _, law in self.boxes.contact.laws]
        if not any(law.planes for law in laws):
            return start, neighbour, image, None
        tables: list[tuple[np.ndarray, np.ndarray]] = [(np.ones(d), np.zeros(d))]
        row = np.repeat(np.arange(self.owned), np.diff(start))
        rows, neighbours, images = [row], [neighbour], [image]
        for shared in {law.planes: None for law in laws}:
            of_these = np.array([law.planes == shared for law in laws])[self.boxes.law]
            mine = np.flatnonzero(of_these[pair[row]])
            limit = 2.0 * self.half[pair[row[mine]]]
            for R, T in reflections(shared, d):
                mirrored = place[neighbour[mine]] * R + T
                gap = np.linalg.norm(place[row[mine]] - mirrored, axis=1)
                # a particle on a plane is its own image there
                off = (np.abs(mirrored - place[neighbour[mine]]) > 1e-6 * limit[:, None])[:, R < 0.0].all(axis=1)
                chosen = mine[(gap < limit) & off]
                rows.append(row[chosen])
                neighbours.append(neighbour[chosen])
                images.append(np.full(len(chosen), len(tables), np.int8))
                tables.append((R, T))
        mirrors = np.zeros((2, len(tables), 4))
        # identity beyond the dimension
        mirrors[0] = 1.0
        mirrors[:, :, :d] = np.array(tables).swapaxes(0, 1)
        row, neighbour, image = (np.concatenate(pieces) for pieces in (rows, neighbours, images))
        order = np.argsort(row, kind="stable")
        start = np.concatenate(([0], np.cumsum(np.bincount(row, minlength=self.owned)))).astype(np.int64)
        return start, neighbour[order], image[order], mirrors


def _kept(start: np.ndarray, neighbour: np.ndarray, keep: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows with only some of their neighbours."""
    before = np.concatenate(([0], np.cumsum(keep)))
    return before[start].astype(np.int64), neighbour[keep]
