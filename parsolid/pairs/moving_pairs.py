"""Lists of pairs of particles that move: made anew with a skin, now and then, and safe in between without a word
between ranks.

A particle stays with its rank until the work of ghosts has grown; then all are dealt out anew. The scheme of lists with
a skin is Verlet's (Physical Review 159, 1967).
"""

import time as clock
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.cells import checked_bounds
from decomposition.close_pairs import ClosePairs, strips_of
from decomposition.halo import Halo
from decomposition.measured_load import MeasuredLoad
from decomposition.migration import migrate
from decomposition.partition import bisect
from parsolid.collective import maximum, raise_together
from parsolid.pairs.candidates import bonded_only, coincident, images_near, rows_of_images
from parsolid.pairs.displacement import Allowance, body_bounds, body_motions, skin_use
from parsolid.pairs.lists import Images, InnerList, OneSidedList
from parsolid.pairs.pair_lists import PairLists
from parsolid.particles.declaration import Field

# rebuilds after which particles are dealt out anew in any case, and between looks at what steps have cost
_LONGEST, _LOOKS = 16, 4
# storage is sorted anew when this share of the particles has its successor in space so many rows away
_DISORDER, _FAR = 0.1, 64
# of the reach of ghosts over that of pairs, whose distance test repeats in other arithmetic
_HAIR = 1.0 + 1e-9


class MovingPairs(PairLists):
    """Pairs closer than support (h_a + h_b)/2 (1 + skin) when the lists were made; their weights are formed in passes.

    It reads the fields position (d,) [m], velocity (d,) [m/s], body, and smoothing_length [m], which may change only
    just before a rebuild, and declares listed_position.
    unbonded: bodies (bodies, bodies) that make no pairs with one another, None where all may; set before `rebuild`;
    load: by which ranks get unlike shares of all particles, None where they get equal ones; rebuilds, dealt: how often
    lists were made and particles dealt out anew; migrated, seconds: particles that this rank gave away, time of its
    processor [s]; late: how often `due` found that lists had been used too long, which a smaller step or a wider skin
    cures.
    """

    def __init__(
        self,
        comm: Any,
        particles: Any,
        space: Any,
        support: float,
        skin: float,
        codes: Any = None,
        rebalance: float = 1.1,
    ) -> None:
        """support: of the kernel, in smoothing lengths; skin: part of it that is listed besides; codes: `MirrorCodes`
        or None; rebalance: growth of the busiest rank's owned particles and ghosts after which all are dealt out anew.

        Raises ValueError for a support or a skin that is not positive.
        """
        if not (support > 0.0 and skin > 0.0):
            raise ValueError(f"support, skin: expected positive numbers, found {support}, {skin}")
        self.comm, self.particles, self.space = comm, particles, space
        self.support, self.skin, self.codes, self.rebalance = support, skin, codes, rebalance
        self.unbonded: np.ndarray | None = None
        self.load: MeasuredLoad | None = None
        self._shares: np.ndarray | None = None
        self.rebuilds = self.dealt = self.migrated = self.late = 0
        self.seconds, self.built_at = 0.0, 0.0
        self._search = ClosePairs()
        # of the busiest rank, just after particles were dealt out; rebuilds since
        self._dealt_load, self._since = 0, 0
        particles.declare(Field("listed_position", space.dimension, "m", checkpointed=True))

    # --- when -------------------------------------------------------------------------------------------------

    def due(self, time: float, next_step: float) -> bool:
        """Whether this rank wants lists made at a time [s], so that they are safe for twice a next step [s] to come."""
        read = self.particles.owned_rows
        allowance = Allowance(0.5 * self.skin * self.support, self.reach, time - self.built_at, 2.0 * next_step)
        fields = (read(name) for name in ("position", "velocity", "listed_position", "smoothing_length", "body"))
        use = skin_use(*fields, self.motions, allowance)
        self.late += use > 1
        return bool(use)

    # --- making lists -----------------------------------------------------------------------------------------

    def rebuild(self, time: float) -> None:
        """Deal particles out where it pays, sort them where they are out of order, plan ghosts, make every list.

        Collective. Rows change: what has looked them up does so again. The message "reference" is sent. Raises
        SolverError, on all ranks, in the first rebuild, for particles at one place and for mirror planes too close.
        """
        began = clock.process_time()
        particles = self.particles
        load, boxes = self._survey(particles.owned_rows("position"))
        if self.comm.size > 1 and (self._must_deal(load) | self._unlike_measured()):
            self._deal_out()
        self._sort()
        self.built_at = time
        particles.owned_rows("listed_position")[:] = particles.owned_rows("position")
        self.motions = body_motions(self._mean_velocities(), *boxes, self.codes)
        self._list()
        if self.rebuilds == 0:
            self._check()
        particles.update("reference")
        self.rebuilds += 1
        self._since += 1
        self.seconds += clock.process_time() - began

    def _survey(self, positions: np.ndarray) -> tuple[int, tuple[np.ndarray, np.ndarray]]:
        """The busiest rank's load, and boxes (bodies, d) of the bodies at positions (owned, d); sets the reach."""
        particles, length = self.particles, self.particles.owned_rows("smoothing_length")
        mine = body_bounds(positions, particles.owned_rows("body"), len(particles.law_of_body))
        load = particles.owned + particles.ghosts
        all_of_it = maximum(self.comm, np.concatenate(([load, length.max(initial=0.0)], mine.ravel())))
        self.reach = float(self.support * (1.0 + self.skin) * all_of_it[1])
        boxes = all_of_it[2:].reshape(mine.shape)
        return int(all_of_it[0]), (-boxes[:, 0], boxes[:, 1])

    def _mean_velocities(self) -> np.ndarray:
        """Of every body (bodies, d) [m/s]; collective."""
        particles = self.particles
        velocity, body = particles.owned_rows("velocity"), particles.owned_rows("body")
        bodies, d = len(particles.law_of_body), velocity.shape[1]
        sums = np.empty((d + 1, bodies))
        for k in range(d):
            sums[k] = np.bincount(body, velocity[:, k], minlength=bodies)
        sums[d] = np.bincount(body, minlength=bodies)
        self.comm.Allreduce(MPI.IN_PLACE, sums, MPI.SUM)
        return np.ascontiguousarray((sums[:d] / np.maximum(sums[d], 1.0)).T)

    def _must_deal(self, load: int) -> bool:
        if self._since == 1:
            self._dealt_load = load
        return self.rebuilds == 0 or self._since >= _LONGEST or load > self.rebalance * self._dealt_load

    def _unlike_measured(self) -> bool:
        """Whether steps have cost ranks so unlike times that other shares are worth their price; collective."""
        if self.load is None or self.rebuilds == 0 or self.rebuilds % _LOOKS != 0:
            return False
        shares = self.load.look(self.particles.owned)
        if shares is not None:
            self._shares = shares
        return shares is not None

    def _deal_out(self) -> None:
        """Every rank a compact part of all particles, its share; collective."""
        particles = self.particles
        owner = bisect(self.comm, np.ascontiguousarray(particles.owned_rows("position")), shares=self._shares)
        leaving = np.flatnonzero(owner != self.comm.rank)
        moved = migrate(self.comm, owner[leaving], {"rows": particles.packed(leaving)})["rows"]
        particles.detach()
        particles.remove(leaving)
        particles.insert(moved)
        self.dealt, self.migrated, self._since = self.dealt + 1, self.migrated + len(leaving), 0

    def _sort(self) -> None:
        """Bring particles into the order in space in which pairs are looked for, if they are far from it."""
        points = np.ascontiguousarray(self.particles.owned_rows("position"))
        if len(points) == 0:
            return
        order, _ = strips_of(*checked_bounds(points), self.reach).order(points)
        if (np.abs(np.diff(order)) > _FAR).sum() > _DISORDER * len(points):
            self.particles.reorder(order)

    def _list(self) -> None:
        """Ghosts and lists from the listed positions; collective."""
        particles = self.particles
        points = np.ascontiguousarray(particles.owned_rows("listed_position"))
        self.halo = Halo.plan(self.comm, points, self.reach * _HAIR)
        particles.attach(self.halo)
        factor = 0.5 * self.support * (1.0 + self.skin)
        columns = points, factor * particles.owned_rows("smoothing_length"), particles.owned_rows("body")
        whole = self.halo.with_ghosts(np.column_stack(columns))
        positions, radius = np.ascontiguousarray(whole[:, : points.shape[1]]), np.ascontiguousarray(whole[:, -2])
        start, neighbour, outer, ghost = self._search.find(positions, radius, self.owned)
        if self.unbonded is not None:
            body = whole[:, -1].astype(np.int64)
            start, neighbour, _ = bonded_only((start, neighbour, neighbour), body, self.unbonded)
            outer, ghost, _ = bonded_only((outer, ghost, ghost), body, self.unbonded)
        weightless = np.empty((0, 4))
        self.inner = InnerList(start, neighbour, weightless)
        self.rim = OneSidedList(outer, ghost, weightless, None) if self.comm.size > 1 else None
        if self.codes is not None:
            self.mirror = self._images(positions, radius, whole[:, -1].astype(np.int64))

    def _images(self, positions: np.ndarray, radius: np.ndarray, body: np.ndarray) -> OneSidedList:
        """Pairs of owned particles with images behind mirror planes."""
        d, rows, neighbours, kinds = positions.shape[1], [], [], []
        nearby = images_near(positions, body, self.owned, self.codes, np.full(d, self.reach * _HAIR))
        for code, receivers, givers, images in nearby:
            start, image = self._search.across(positions[receivers], radius[receivers], images, radius[givers])
            rows.append(np.repeat(receivers, np.diff(start)))
            neighbours.append(givers[image])
            kinds.append(np.full(len(image), code, np.int8))
        lists = rows_of_images((rows, neighbours, kinds), self.owned)
        start, neighbour, kind = lists if self.unbonded is None else bonded_only(lists, body, self.unbonded)
        return OneSidedList(start, neighbour, np.empty((0, 4)), Images(kind, self.codes.table(d)))

    def _check(self) -> None:
        """Raise SolverError on all ranks for what no list can be made of."""
        positions = self.halo.with_ghosts(np.ascontiguousarray(self.particles.owned_rows("listed_position")))
        fault = None
        for pairs in (self.inner, self.rim):
            if pairs is not None:
                row = np.repeat(np.arange(self.owned), np.diff(pairs.start))
                same = (positions[row] == positions[pairs.neighbour]).all(axis=1)
                fault = coincident(positions, pairs.start, int(np.argmax(same))) if same.any() else fault
        raise_together(self.comm, fault)
        if self.codes is not None:
            raise_together(self.comm, self.codes.too_close(np.full(positions.shape[1], self.reach)))

    def summary(self) -> dict[str, Any]:
        """How often lists were made anew, how often too late, and particles that changed their rank; collective."""
        return {
            "lists_made": self.rebuilds,
            "list_seconds": maximum(self.comm, self.seconds),
            "migrated_particles": self.comm.allreduce(self.migrated),
            "lists_made_late": self.comm.allreduce(self.late),
            **(self.load.summary() if self.load is not None else {}),
        }

    # --- restart ----------------------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """What the same lists need besides the checkpointed fields, as JSON, the same on all ranks; collective."""
        return {
            "ranks": self.comm.size,
            "built_at": self.built_at,
            "velocities": self.motions.velocity.tolist(),
            "rebuilds": self.rebuilds,
            "dealt": self.dealt,
            "late": self.comm.allgather(self.late),
            "migrated": self.comm.allgather(self.migrated),
            "dealt_load": self._dealt_load,
            "since": self._since,
            "shares": None if self._shares is None else self._shares.tolist(),
        }

    def restore(self, state: dict[str, Any], time: float) -> None:
        """The lists of a checkpoint, to the bit on as many ranks, made anew at its time [s] on others; collective."""
        self.rebuilds, self.dealt = state["rebuilds"], state["dealt"]
        self._dealt_load, self._since = state["dealt_load"], state["since"]
        if state["ranks"] != self.comm.size:
            # dealt out by reference positions so far
            self._since = _LONGEST
            if self.comm.rank == 0:
                self.late, self.migrated = sum(state["late"]), sum(state["migrated"])
            self.rebuild(time)
            return
        self.late, self.migrated = state["late"][self.comm.rank], state["migrated"][self.comm.rank]
        self._shares = np.array(state["shares"]) if state.get("shares") else None
        self.built_at = state["built_at"]
        _, boxes = self._survey(self.particles.owned_rows("listed_position"))
        self.motions = body_motions(np.array(state["velocities"]), *boxes, self.codes)
        self._list()
        self.particles.update("reference")
