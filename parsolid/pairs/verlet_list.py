"""Verlet lists: the pairs of particles that move, listed with a skin and made anew when the skin is used up.

L. Verlet, Physical Review 159 (1967). A particle stays with its rank until the number of ghosts has grown; then all
particles are distributed anew.
"""

import time as clock
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from decomposition.bisection import bisect
from decomposition.halo import REACH_MARGIN, Halo
from decomposition.migration import migrate
from decomposition.pair_search import ClosePairs, checked_bounds, strips_of
from parsolid.collective import maximum, raise_together
from parsolid.pairs.candidates import coincident, images_near
from parsolid.pairs.displacement import LATE, Allowance, body_bounds, body_motions, skin_use
from parsolid.particles.declaration import Columns, Field

# list builds after which particles are distributed anew in any case, and between checks of the measured cost of steps
_MOST_BUILDS = 16
# particles are sorted anew when this share of them has its successor in space so many rows away
_DISORDER, _FAR = 0.1, 64
# number of bodies up to which all pairs of bodies are followed, and the distance in reaches within which those of more
# bodies are
_FEW_BODIES, _FAR_BODIES = 64, 4.0


class Pairs(NamedTuple):
    """Particle a and its neighbours, rows neighbour[start[a]] .. neighbour[start[a + 1] - 1]."""

    start: np.ndarray
    neighbour: np.ndarray

    @property
    def particle(self) -> np.ndarray:
        """Particle a of every pair."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))

    def where(self, chosen: np.ndarray) -> "Pairs":
        """The pairs that a mask (pairs,) chooses."""
        before = np.concatenate(([0], np.cumsum(chosen)))
        return Pairs(before[self.start].astype(np.int64), self.neighbour[chosen])


class Images(NamedTuple):
    """Mirror images with pairs, in rows behind the ghosts: rows of the particles and ghosts that they mirror, and their
    codes in `MirrorCodes`."""

    source: np.ndarray
    code: np.ndarray


class VerletList:
    """Pairs closer than support (h_a + h_b)/2 (1 + skin) when the list was made.

    inner: each pair of owned particles once; outer: pairs of owned particles and ghosts, None on one rank; mirror:
    owned particles and mirror images, which are rows behind the ghosts, None without mirror planes; images: those rows.
    unbonded: pairs of bodies that make no pairs of particles, see `scene.contact.BodyPairs`, None where all may; set
    before `rebuild`.
    listed_travel: how far moving planes of the codes had gone when the list was made [m].
    builds, distributions: how often the list was made and particles were distributed; migrated: particles that this
    rank sent to others; seconds: processor time of lists and distributions [s]; late: how often the list was used too
    long, which a smaller step or a wider skin avoids.

    It reads the fields position, velocity, body and smoothing_length, where images are carried
    reference_position, and declares listed_position. Smoothing lengths change just before a rebuild only.
    """

    inner: Pairs
    outer: Pairs | None = None
    mirror: Pairs | None = None
    images: Images | None = None
    halo: Halo

    def __init__(
        self,
        comm: Any,
        particles: Any,
        dimension: int,
        support: float,
        skin: float,
        codes: Any = None,
        rebalance: float = 1.1,
    ) -> None:
        """support: of the kernel, over the smoothing length; skin: part of it that is listed besides; codes:
        `MirrorCodes` or None; rebalance: growth of the busiest rank's owned particles and ghosts after which all are
        distributed anew.

        Raises ValueError for a support or a skin that is not positive.
        """
        if not (support > 0.0 and skin > 0.0):
            raise ValueError(f"support, skin: expected positive numbers, found {support}, {skin}")
        self.comm, self.particles = comm, particles
        self.support, self.skin, self.codes, self.rebalance = support, skin, codes, rebalance
        self.unbonded: Any = None
        self.builds = self.distributions = self.migrated = self.late = 0
        self.seconds, self.built_at, self._far_apart = 0.0, 0.0, np.inf
        self._search = ClosePairs()
        # load of the busiest rank after the last distribution, and builds since then
        self._load_then, self._builds_since = 0, 0
        particles.declare(Field("listed_position", dimension, "m", checkpointed=True, layout=Columns()))

    @property
    def owned(self) -> int:
        return self.halo.owned

    def expires(self, time: float, next_step: float) -> bool:
        """Whether this rank wants a new list at a time [s], because this one is not safe for twice a next step [s]."""
        share = 0.5 * self.skin * self.support - self._used_by_planes(2.0 * next_step)
        allowance = Allowance(share, self.reach, time - self.built_at, 2.0 * next_step)
        names = ("position", "velocity", "listed_position", "smoothing_length", "body")
        arrays = (self.particles.storage(name) for name in names)
        use = skin_use(self.particles.owned, *arrays, self.motions, allowance)
        self.late += use == LATE
        return bool(use) or time - self.built_at + 2.0 * next_step > self._far_apart

    def _used_by_planes(self, ahead: float) -> float:
        """The part of the allowed displacement, over the smoothing length, that moving planes use up by the end of the
        time ahead [s]."""
        codes = self.codes
        if codes is None or not codes.moving:
            return 0.0
        moved = np.abs(codes.travelled - self.listed_travel).max() + 0.5 * ahead * np.abs(codes.velocities).max()
        return float(moved / self.particles.storage("smoothing_length").min(initial=np.inf))

    # --- making the list --------------------------------------------------------------------------------------

    def rebuild(self, time: float) -> None:
        """Distribute particles where it pays, sort them where they are out of order, find ghosts and pairs.

        Collective. Particles change their rows. The message "reference" is sent. Raises SolverError, on all ranks, in
        the first rebuild, for particles at one place and for mirror planes too close to one another.
        """
        began = clock.process_time()
        particles = self.particles
        load, boxes = self._survey(particles.owned_rows("position"))
        if self.comm.size > 1 and self._load_has_grown(load):
            self._distribute()
        self._sort()
        self.built_at = time
        if self.codes is not None:
            self.listed_travel = self.codes.travelled
        particles.owned_rows("listed_position")[:] = particles.owned_rows("position")
        self._follow(self._mean_velocities(), *boxes)
        self._find_pairs()
        if self.builds == 0:
            # raise SolverError on all ranks for what no list can be made of
            positions = self.halo.with_ghosts(np.ascontiguousarray(self.particles.owned_rows("listed_position")))
            fault = None
            for pairs in (self.inner, self.outer):
                if pairs is not None:
                    same = (positions[pairs.particle] == positions[pairs.neighbour]).all(axis=1)
                    fault = coincident(positions, pairs.start, int(np.argmax(same))) if same.any() else fault
            raise_together(self.comm, fault)
            if self.codes is not None:
                raise_together(self.comm, self.codes.too_close(np.full(positions.shape[1], self.reach)))
        particles.update("reference")
        self.builds += 1
        self._builds_since += 1
        self.seconds += clock.process_time() - began

    def _survey(self, positions: np.ndarray) -> tuple[int, tuple[np.ndarray, np.ndarray]]:
        """The busiest rank's load, and the boxes (bodies, d) of bodies at positions (owned, d); sets the reach."""
        particles, length = self.particles, self.particles.owned_rows("smoothing_length")
        mine = body_bounds(positions, particles.owned_rows("body"), len(particles.law_of_body))
        load = particles.owned + particles.ghosts
        together = maximum(self.comm, np.concatenate(([load, length.max(initial=0.0)], mine.ravel())))
        self.reach = float(self.support * (1.0 + self.skin) * together[1])
        boxes = together[2:].reshape(mine.shape)
        return int(together[0]), (-boxes[:, 0], boxes[:, 1])

    def _follow(self, velocity: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
        """Motions of bodies with mean velocities (bodies, d) [m/s] in boxes (bodies, d) [m], of many with those that
        are near alone, and how long [s] the others stay apart."""
        far = np.inf if len(velocity) <= _FEW_BODIES else _FAR_BODIES * self.reach
        self.motions = body_motions(velocity, lower, upper, self.codes, far)
        seen = velocity if self.codes is not None else velocity - velocity.mean(axis=0)
        fastest = 2.0 * float(np.linalg.norm(seen, axis=1).max(initial=0.0))
        # particles of both bodies may leave their boxes by half a skin
        self._far_apart = (far - 2.0 * self.reach) / fastest if fastest > 0.0 else np.inf

    def _mean_velocities(self) -> np.ndarray:
        """Mean velocity of every body (bodies, d) [m/s]; collective."""
        particles = self.particles
        velocity, body = particles.owned_rows("velocity"), particles.owned_rows("body")
        bodies, d = len(particles.law_of_body), velocity.shape[1]
        sums = np.empty((d + 1, bodies))
        for k in range(d):
            sums[k] = np.bincount(body, velocity[:, k], minlength=bodies)
        sums[d] = np.bincount(body, minlength=bodies)
        self.comm.Allreduce(MPI.IN_PLACE, sums, MPI.SUM)
        return np.ascontiguousarray((sums[:d] / np.maximum(sums[d], 1.0)).T)

    def _load_has_grown(self, load: int) -> bool:
        if self._builds_since == 1:
            self._load_then = load
        return self.builds == 0 or self._builds_since >= _MOST_BUILDS or load > self.rebalance * self._load_then

    def _distribute(self) -> None:
        """Every rank gets a compact part of all particles, equal in number; collective."""
        particles = self.particles
        owner = bisect(self.comm, np.ascontiguousarray(particles.owned_rows("position")))
        leaving = np.flatnonzero(owner != self.comm.rank)
        moved = migrate(self.comm, owner[leaving], {"rows": particles.packed(leaving)})["rows"]
        particles.detach()
        particles.remove(leaving)
        particles.insert(moved)
        self.distributions, self.migrated = self.distributions + 1, self.migrated + len(leaving)
        self._builds_since = 0

    def _sort(self) -> None:
        """Bring particles into the order in space in which pairs are looked for, if they are far from it."""
        points = np.ascontiguousarray(self.particles.owned_rows("position"))
        if len(points) == 0:
            return
        order, _ = strips_of(*checked_bounds(points), self.reach).order(points)
        if (np.abs(np.diff(order)) > _FAR).sum() > _DISORDER * len(points):
            self.particles.reorder(order)

    def _find_pairs(self) -> None:
        """Ghosts and pairs of the listed positions; collective."""
        particles = self.particles
        points = np.ascontiguousarray(particles.owned_rows("listed_position"))
        self.halo = Halo(self.comm, points, self.reach * REACH_MARGIN)
        particles.attach(self.halo)
        half_reach = 0.5 * self.support * (1.0 + self.skin) * particles.owned_rows("smoothing_length")
        whole = self.halo.with_ghosts(np.column_stack((points, half_reach, particles.owned_rows("body"))))
        positions, radius = np.ascontiguousarray(whole[:, :-2]), np.ascontiguousarray(whole[:, -2])
        body = whole[:, -1].astype(np.int64)
        start, neighbour, outer_start, ghost = self._search.find(positions, radius, self.owned)
        self.inner = self._bonded(Pairs(start, neighbour), body)
        if self.comm.size > 1:
            self.outer = self._bonded(Pairs(outer_start, ghost), body)
        if self.codes is not None:
            reference = None
            if self.codes.carried:
                reference = self.halo.with_ghosts(np.ascontiguousarray(particles.owned_rows("reference_position")))
            mirror, images = self._find_images(positions, reference, radius, body)
            body = np.concatenate((body, body[images.source]))
            self.mirror, self.images = self._bonded(mirror, body), images

    def _bonded(self, pairs: Pairs, body: np.ndarray) -> Pairs:
        """The pairs without those of two bodies that make no pairs; body (rows,)."""
        if self.unbonded is None:
            return pairs
        return pairs.where(~self.unbonded.between(body[pairs.particle], body[pairs.neighbour]))

    def _find_images(
        self, positions: np.ndarray, reference: np.ndarray | None, radius: np.ndarray, body: np.ndarray
    ) -> tuple[Pairs, Images]:
        """Pairs of owned particles with images behind mirror planes of particles at positions (rows, d), and those
        images; reference: positions at the start where images are carried, else None."""
        particles, sources, codes, images = ([np.zeros(0, np.int64)] for _ in range(4))
        reach, found = np.full(positions.shape[1], self.reach * REACH_MARGIN), 0
        for code, receivers, givers, places in images_near(positions, body, self.owned, self.codes, reach, reference):
            start, image = self._search.across(positions[receivers], radius[receivers], places, radius[givers])
            used, number = np.unique(image, return_inverse=True)
            particles.append(np.repeat(receivers, np.diff(start)))
            images.append(len(positions) + found + number)
            sources.append(givers[used])
            codes.append(np.full(len(used), code))
            found += len(used)
        row, image = np.concatenate(particles), np.concatenate(images)
        order = np.lexsort((image, row))
        start = np.concatenate(([0], np.cumsum(np.bincount(row, minlength=self.owned))))
        pairs = Pairs(start.astype(np.int64), image[order].astype(np.int32))
        return pairs, Images(np.concatenate(sources), np.concatenate(codes))

    # --- what is reported -------------------------------------------------------------------------------------

    @property
    def directed_pairs(self) -> int:
        one_sided = sum(len(pairs.neighbour) for pairs in (self.outer, self.mirror) if pairs is not None)
        return 2 * len(self.inner.neighbour) + one_sided

    def arrays(self) -> list[np.ndarray]:
        lists = (pairs for pairs in (self.inner, self.outer, self.mirror) if pairs is not None)
        return [array for pairs in lists for array in pairs]

    def summary(self) -> dict[str, Any]:
        """How often the list was made, how often too late, and particles that changed their rank; collective."""
        return {
            "lists_made": self.builds,
            "list_seconds": maximum(self.comm, self.seconds),
            "migrated_particles": self.comm.allreduce(self.migrated),
            "lists_made_late": self.comm.allreduce(self.late),
        }

    # --- restart ----------------------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """The state of the list besides the checkpointed fields, as JSON, the same on all ranks; collective."""
        return {
            "ranks": self.comm.size,
            "built_at": self.built_at,
            "velocities": self.motions.velocity.tolist(),
            "builds": self.builds,
            "distributions": self.distributions,
            "late": self.comm.allreduce(self.late),
            "migrated": self.comm.allreduce(self.migrated),
            "load_then": self._load_then,
            "builds_since": self._builds_since,
            "travel": None if self.codes is None else [self.listed_travel.tolist(), self.codes.travelled.tolist()],
        }

    def restore(self, state: dict[str, Any], time: float) -> None:
        """The list of a checkpoint, to the bit on as many ranks, made anew at its time [s] on others. Collective;
        the message "reference" is sent."""
        self.builds, self.distributions = state["builds"], state["distributions"]
        self._load_then, self._builds_since = state["load_then"], state["builds_since"]
        if self.codes is not None:
            self.listed_travel, travelled = map(np.array, state["travel"])
            self.codes.put(travelled)
        if self.comm.rank == 0:
            self.late, self.migrated = state["late"], state["migrated"]
        if state["ranks"] != self.comm.size:
            # distributed by reference positions so far
            self._builds_since = _MOST_BUILDS
            self.rebuild(time)
            return
        self.built_at = state["built_at"]
        _, boxes = self._survey(self.particles.owned_rows("listed_position"))
        self._follow(np.array(state["velocities"]), *boxes)
        if self.codes is not None:
            self.codes.put(self.listed_travel)
        self._find_pairs()
        if self.codes is not None:
            self.codes.put(travelled)
        self.particles.update("reference")
