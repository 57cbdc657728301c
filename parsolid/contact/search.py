"""Contact candidates of a rank: its particles near other bodies, their ghosts on other ranks, and pairs of them.

Within one body, pairs may touch whose distance in the reference is at least twice the kernel's reach, so that
compression to a stretch of one half brings no other pairs within reach, and pairs whose bond has broken. The colour of
broken neighbours in the reference is the least threshold of a particle: nothing acts in the reference, however many of
its bonds are broken.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import REACH_MARGIN, Halo
from decomposition.pair_search import ClosePairs
from parsolid.contact.bodies import areas_of, images_behind, near_box, shares_of
from parsolid.contact.broad_phase import BroadPhase
from parsolid.contact.forces import Candidates, Pairs, may_press
from parsolid.contact.kernel import norm, shapes_and_slopes
from parsolid.contact.time_step import SEEN
from parsolid.kernels import kernel
from parsolid.methods.protocol import BrokenPairs, ParticleSystem
from parsolid.particles.container import Particles
from parsolid.particles.generated import cell_volumes

# least distance in the reference, over the kernel's reach, of particles of one body that may touch
_APART = 2.0


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


class Segment(NamedTuple):
    """The candidates of one system: one for each body that a particle may touch.

    rows, pair (k,): particle and body pair of each; here: where they are among the owned ones; particle_rows: of the
    particles, each once.
    """

    system: ParticleSystem
    rows: np.ndarray
    pair: np.ndarray
    here: slice
    particle_rows: np.ndarray

    @property
    def particles(self) -> Particles:
        return self.system.particles


class Search:
    """Candidates of one rank.

    segments: by system; halo: of their ghosts; points, pairs: see `forces`; owned: number of this rank's own; pair
    (owned,): body pairs, see `BroadPhase`.
    """

    def __init__(self, comm: Any, boxes: BroadPhase, systems: list[ParticleSystem], columns: int) -> None:
        """columns: of the field "contact_depth"."""
        self.comm, self.broad_phase, self.systems = comm, boxes, systems
        self._columns, self._search = columns, ClosePairs()
        # of systems with contact within one body
        self._touching = [bool(boxes.contact.alone[list(system.bodies)].any()) for system in systems]
        self._broken: dict[ParticleSystem, BrokenPairs | None] = {}

    def build(self, prune: bool) -> None:
        """Candidates and pairs at the present positions; collective. prune: leave out candidates that cannot be in
        contact while the lists are valid."""
        boxes = self.broad_phase
        self._broken = {one: one.broken_pairs() if here else None for one, here in zip(self.systems, self._touching)}
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
        if any(self._touching):
            reference = halo.with_ghosts(self.gathered("reference_position"))
            number, distance = pair[row], np.linalg.norm(reference[row] - reference[neighbour], axis=1)
            kept = (boxes.own != boxes.other)[number] | (distance >= _APART * boxes.reach[number])
            near = np.flatnonzero(~kept)
            kept[near] = np.isin(_key(particle[row[near]], particle[neighbour[near]]), self._broken_keys())
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
        for system, rows, pair, here, _ in segments:
            kept, here = mine[here], slice(int(before[here.start]), int(before[here.stop]))
            if kept.any():
                self.segments.append(Segment(system, rows[kept], pair[kept], here, np.unique(rows[kept])))

    def _segments(self, reach: np.ndarray) -> list[Segment]:
        """Particles within reach (body pairs,) [m] of other bodies, without those deleted before the last forces."""
        result: list[Segment] = []
        boxes, near, first = self.broad_phase, np.flatnonzero(self.broad_phase.near), 0
        for system in self.systems:
            of, local = system.particles.owned_rows, np.full(boxes.bodies, -1)
            local[list(system.bodies)] = np.arange(len(system.bodies))
            mine = near[local[boxes.own[near]] >= 0]
            order = np.argsort(of("body"), kind="stable")
            ends = np.searchsorted(of("body")[order], np.arange(len(system.bodies) + 1))
            # particles of the own body of each pair, pair after pair
            begin, count = ends[local[boxes.own[mine]]], np.diff(ends)[local[boxes.own[mine]]]
            pair = np.repeat(mine, count)
            rows = order[np.arange(len(pair)) + np.repeat(begin - np.cumsum(count) + count, count)]
            other = boxes.other[pair]
            kept = near_box(of("position")[rows], boxes.lower[other], boxes.upper[other], reach[pair])
            kept |= boxes.own[pair] == other
            if "deleted_mass" in system.particles:
                kept &= (of("deleted_mass")[rows] <= 0.0) | of("contact_force")[rows].any(axis=1)
            if kept.any():
                here = slice(first, first + int(kept.sum()))
                result.append(Segment(system, rows[kept], pair[kept], here, rows))
                first = here.stop
        return result

    def _constants(self) -> np.ndarray:
        """Share, whole volume [m^3], threshold, 1/slope, stiffness, 1/R and norm (7, owned), see `Candidates`."""
        result, boxes = np.zeros((7, self.owned)), self.broad_phase
        for segment in self.segments:
            system, number = segment.system, boxes.law[segment.pair]
            found, depth = self._broken[system], system.particles.storage("contact_depth")
            for k in np.unique(number):
                (kind, law), chosen = boxes.contact.laws[k], np.flatnonzero(number == k)
                rows, pair = segment.rows[chosen], segment.pair[chosen]
                inside = depth.reshape(-1, self._columns)[rows, boxes.contact.columns[kind][law.reach, law.planes]]
                colour, slope = law.threshold(inside)
                if found is not None and len(found.row):
                    shapes, _ = shapes_and_slopes(found.distance / law.reach)
                    weight = norm(system.dimension, law.reach) * found.volume * shapes
                    least = np.bincount(found.row, weight, minlength=system.particles.owned)[rows]
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
            for R, T, off, image in images_behind(shared, place[behind], 2e-6 * half[behind]):
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

    def _broken_keys(self) -> np.ndarray:
        """Numbers of the pairs of identifiers whose bonds have broken."""
        keys = [np.zeros(0, np.int64)]
        for system, found in self._broken.items():
            if found is not None:
                mine = system.particles.owned_rows("identifier")[found.row]
                keys.append(_key(mine.astype(np.int64), found.identifier))
        return np.concatenate(keys)

    def leave_out_deleted(self) -> None:
        """Take owned candidates of deleted particles out of contact."""
        for segment in self.segments:
            if "deleted_mass" in segment.particles:
                deleted = segment.particles.owned_rows("deleted_mass")[segment.rows]
                gone = segment.here.start + np.flatnonzero(deleted > 0.0)
                self.points.rows[gone, 3], self.pairs.active[gone] = 0.0, 0

    def gathered(self, name: str) -> np.ndarray:
        """A field of the particles of the owned candidates."""
        pieces = [segment.particles.owned_rows(name)[segment.rows] for segment in self.segments]
        return np.ascontiguousarray(np.concatenate(pieces or [self.systems[0].particles.owned_rows(name)[:0]]))


def _key(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """One number for each ordered pair of identifiers."""
    return np.asarray(first * np.int64(1 << 31) + second)
