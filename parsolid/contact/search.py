"""Contact candidates of a rank: its particles near other bodies, their ghosts on other ranks, and pairs of them."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import REACH_MARGIN, Halo
from decomposition.pair_search import ClosePairs
from parsolid.contact.bodies import BodyKind, ContactLaw, areas_of, mirrored, reflections, shares_of
from parsolid.contact.broad_phase import BroadPhase
from parsolid.contact.forces import Candidates, Pairs, may_press
from parsolid.contact.self_contact import SelfContact
from parsolid.contact.time_step import SEEN
from parsolid.kernels import kernel
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.generated import cell_volumes


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


class Search:
    """Candidates of one rank.

    segments: by system; halo: of their ghosts; points, pairs: see `forces`; owned: number of this rank's own; pair
    (owned,): body pairs, see `BroadPhase`.
    """

    def __init__(
        self, comm: Any, boxes: BroadPhase, systems: list[ParticleSystem], self_contact: SelfContact, columns: int
    ) -> None:
        """columns: of the field "contact_depth"."""
        self.comm, self.broad_phase, self.systems, self.self_contact = comm, boxes, systems, self_contact
        self._columns, self._search = columns, ClosePairs()

    def build(self, prune: bool) -> None:
        """Candidates and pairs at the present positions; collective. prune: leave out candidates that cannot be in
        contact while the lists are valid."""
        boxes = self.broad_phase
        half = 0.5 * (boxes.reach + boxes.beyond)
        self.segments = self._segments(2.0 * half)
        owned = self.owned = self.segments[-1].here.stop if self.segments else 0
        self.pair = np.concatenate([np.zeros(0, np.int64), *(segment.pair for segment in self.segments)])
        place, identifier = self.gathered("position"), self.gathered("identifier").astype(np.int64)
        share, volume, *of_law = self._constants()
        reach = 2.0 * float(half[boxes.near].max(initial=0.0))
        halo = Halo(self.comm, place, reach * REACH_MARGIN if reach > 0.0 else 1.0)
        d = place.shape[1]
        rows = np.zeros((owned + halo.ghosts, 4))
        rows[:owned, :d], rows[:owned, 3] = place, volume
        halo.forward(rows).now()
        pair, particle = halo.with_ghosts(self.pair), halo.with_ghosts(identifier)
        row, neighbour, image, mirrors = self._neighbours(np.ascontiguousarray(rows[:, :d]), half[pair], pair, particle)
        if any(self.self_contact.touching):
            reference = halo.with_ghosts(self.gathered("reference_position"))
            kept = ~self.self_contact.excluded(boxes, pair, row, neighbour, reference, particle)
            row, neighbour, image = row[kept], neighbour[kept], image[kept]
        active = np.ones(owned, np.int64)
        if prune:
            start = np.searchsorted(row, np.arange(owned + 1))
            pairs = Pairs(start, neighbour, None if mirrors is None else image, mirrors, active)
            points = Candidates._make([rows, rows[:, :3], share, *of_law, d])
            active = may_press(points, pairs, boxes.skin[self.pair], SEEN)
        # pairs of which at least one candidate is active
        acts = halo.with_ghosts(active) > 0
        kept = acts[row] | acts[neighbour]
        row, neighbour, image, used = row[kept], neighbour[kept], image[kept], np.zeros(len(particle), bool)
        used[row] = used[neighbour] = True
        mine, number = used[:owned], (np.cumsum(used) - 1).astype(np.int32)
        self.halo, self.owned, self.pair = halo.subset(used[owned:], mine), int(mine.sum()), self.pair[mine]
        start, neighbour = np.searchsorted(number[row], np.arange(self.owned + 1)), number[neighbour]
        sort_rows(start, neighbour, image, particle[used])
        of_owned: Any = [values[mine] for values in (share, *of_law)]
        self.points = Candidates._make([rows[used], np.zeros((int(used.sum()), 3)), *of_owned, d])
        self.pairs = Pairs(start, neighbour, None if mirrors is None else image, mirrors, active[mine])
        before = np.concatenate(([0], np.cumsum(mine)))
        segments, self.segments = self.segments, []
        for system, of_system, of_bodies, here in segments:
            kept, here = mine[here], slice(int(before[here.start]), int(before[here.stop]))
            if kept.any():
                self.segments.append(Segment(system, of_system[kept], of_bodies[kept], here))

    def _segments(self, reach: np.ndarray) -> list[Segment]:
        """Particles within reach (body pairs,) [m] of other bodies, without those deleted before the last forces."""
        result: list[Segment] = []
        boxes, near, first = self.broad_phase, np.flatnonzero(self.broad_phase.near), 0
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
            kept = near_boxes(of("position")[rows], pair, *box, reach) | (boxes.own == boxes.other)[pair]
            if "deleted_mass" in system.particles:
                kept &= (of("deleted_mass")[rows] <= 0.0) | of("contact_force")[rows].any(axis=1)
            if kept.any():
                here = slice(first, first + int(kept.sum()))
                result.append(Segment(index, rows[kept], pair[kept], here))
                first = here.stop
        return result

    def of_laws(self) -> Iterator[tuple[BodyKind, ContactLaw, Segment, np.ndarray]]:
        """Of each segment the laws, with the kind of the own body and the candidates (k,) of the segment."""
        for segment in self.segments:
            number = self.broad_phase.law[segment.pair]
            for k in np.unique(number):
                yield *self.broad_phase.contact.laws[k], segment, np.flatnonzero(number == k)

    def _constants(self) -> np.ndarray:
        """Share, whole volume [m^3], threshold, 1/slope, stiffness, 1/R and norm (7, owned), see `Candidates`."""
        result, boxes = np.zeros((7, self.owned)), self.broad_phase
        for kind, law, segment, chosen in self.of_laws():
            system, rows, pair = self.systems[segment.system], segment.rows[chosen], segment.pair[chosen]
            depth = system.particles.storage("contact_depth").reshape(-1, self._columns)
            colour, slope = law.threshold(depth[rows, boxes.contact.columns[kind][law.reach, law.planes]])
            least = self.self_contact.least_thresholds(segment.system, law, rows, system.dimension)
            if least is not None:
                colour = np.where((boxes.own == boxes.other)[pair], np.maximum(colour, least), colour)
            share = shares_of(system, rows, law)
            volume = cell_volumes(system.particles)[rows] / share
            stiffness = 0.5 * law.stiffness * areas_of(system, rows, volume, share if kind.nodal else None)
            values = share, volume, colour, 1.0 / slope, stiffness, 1.0 / law.reach, law.norm
            for line, value in zip(result, values):
                line[segment.here.start + chosen] = value
        return result

    def _neighbours(
        self, place: np.ndarray, half: np.ndarray, pair: np.ndarray, particle: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
        """Pairs of owned candidates, rising, with neighbours of the reverse body pair, or their images behind the
        symmetry planes of both bodies: rows, neighbours, numbers of images, and `forces.Pairs.mirrors`.

        place (n, d) [m], half the reach (n,) [m], body pair and identifier (n,) of the particle of all candidates.
        """
        boxes, d = self.broad_phase, place.shape[1]
        planes = [law.planes for _, law in boxes.contact.laws]
        tables = [(np.ones(d), np.zeros(d))]
        sources, images = [np.arange(len(place))], [place]
        for shared in dict.fromkeys(planes):
            behind = np.flatnonzero(np.array([each == shared for each in planes])[boxes.law[pair]])
            for R, T in reflections(shared, d):
                off, image = mirrored(place[behind], R, T, 2e-6 * half[behind])
                sources.append(behind[off])
                images.append(image)
                tables.append((R, T))
        source = np.concatenate(sources)
        number = np.repeat(np.arange(len(tables)), list(map(len, sources))).astype(np.int8)
        mine = slice(self.owned)
        start, found = self._search.across(place[mine], half[mine], np.concatenate(images), half[source])
        row, neighbour = np.repeat(np.arange(self.owned), np.diff(start)), source[found].astype(np.int32)
        kept = (pair[neighbour] == boxes.reverse[pair[row]]) & (particle[neighbour] != particle[row])
        mirrors = np.zeros((2, len(tables), 4))
        # identity beyond the dimension
        mirrors[0] = 1.0
        mirrors[:, :, :d] = np.array(tables).swapaxes(0, 1)
        return row[kept], neighbour[kept], number[found[kept]], mirrors if len(tables) > 1 else None

    def leave_out_deleted(self) -> None:
        """Take owned candidates of deleted particles out of contact."""
        for segment in self.segments:
            particles = self.systems[segment.system].particles
            if "deleted_mass" in particles:
                gone = segment.here.start + np.flatnonzero(particles.owned_rows("deleted_mass")[segment.rows] > 0.0)
                self.points.rows[gone, 3], self.pairs.active[gone] = 0.0, 0

    def gathered(self, name: str) -> np.ndarray:
        """A field of the particles of the owned candidates."""
        pieces = [self.systems[segment.system].particles.owned_rows(name)[segment.rows] for segment in self.segments]
        return np.ascontiguousarray(np.concatenate(pieces or [self.systems[0].particles.owned_rows(name)[:0]]))
