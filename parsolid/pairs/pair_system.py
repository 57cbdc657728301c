"""The pairs of a rank's particles: their lists, weights and corrections, and the two passes with the messages they
need."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from decomposition.halo import Halo
from decomposition.recalled import RecalledEach
from parsolid.collective import maximum, raise_together
from parsolid.pairs.candidates import (
    bonded_only,
    coincident,
    common_metric,
    mirror_candidates,
    plain_candidates,
    reach_of,
)
from parsolid.pairs.lists import Images, InnerList, OneSidedList, Places, empty_list, images_of
from parsolid.pairs.pair_lists import PairLists
from parsolid.pairs.passes import Vector, add_forces, add_gradients, sum_columns
from parsolid.pairs.terms import KINEMATICS, record_columns
from parsolid.pairs.weights import select_pairs
from parsolid.particles.declaration import Columns, Field, Rows, Within

# the vector in the first columns: a velocity, or what drives a stress
FIELD = (Vector(),)
_AS_THEY_STAND = np.ones((1, 3)), np.zeros((1, 3))


class PairSystem(PairLists):
    """Lists of a rank's pairs over the particles' container, and the passes over them; d = dimension of the space.

    It declares `kinematics` (in which the method declares its vectors, at `KINEMATICS[d]`; those of the message
    "reference" reach the ghosts with every rebuild), `record` (sent as the message "record"), `pair_sums`, `pair_force`
    [N], `correction`, `pair_volume`. Passes add to pair_sums and pair_force: whoever reads them sets them to zero.

    unbonded: bodies (bodies, bodies) that make no pairs with one another, None where all may; set before `rebuild`.
    With ghosts behind: positions (n, d) [m], volume (n,) [m^3], metric (n or 1, 6) of `pairs.weights`.
    """

    positions: np.ndarray
    even: np.ndarray
    volume: np.ndarray
    metric: np.ndarray
    unbonded: np.ndarray | None = None

    def __init__(
        self,
        comm: Any,
        particles: Any,
        space: Any,
        weights: Any,
        terms: Any = None,
        codes: Any = None,
        fields: tuple[Any, ...] = FIELD,
    ) -> None:
        """space: of `numerics.layout`; weights: `SmoothedWeights` or `RadialWeights`; codes: `MirrorCodes` or None.

        terms: what acts beside stresses, of `pairs.terms`; fields: what gradients are taken of at once, at most.
        """
        self.comm, self.particles, self.space = comm, particles, space
        self.weights, self.terms, self.codes = weights, terms, codes
        self._add_gradients, self._add_forces = RecalledEach(add_gradients), RecalledEach(add_forces)
        d, record = space.dimension, record_columns(space, terms)
        particles.declare(Field("kinematics", KINEMATICS[d].width, ""))
        particles.declare(Field("record", record.width, "", carried=False))
        told = getattr(record, "changing", record.width)
        particles.declare(Field("told", told, "", ghosts="forward", message="record", layout=Within("record", 0)))
        particles.declare(Field("pair_sums", sum_columns(d, fields), "", layout=Rows(), carried=False))
        particles.declare(Field("pair_force", 4, "N", layout=Rows(), carried=False))
        particles.declare(Field("correction", d * d, "", layout=Columns(), carried=False))
        particles.declare(Field("pair_volume", 1, "m^3", layout=Columns(), padding=(1.0,), carried=False), 1.0)

    # --- lists ------------------------------------------------------------------------------------------------

    def rebuild(
        self,
        positions: np.ndarray,
        body: np.ndarray,
        metric: np.ndarray,
        volume: np.ndarray,
        even: np.ndarray | None = None,
    ) -> None:
        """Plan ghosts and make every list anew; collective.

        even (n, d) [m]: places by which pairs are found, where they are others than the positions.
        Of owned particles: positions (n, d) [m], body (n,), metric (n, 6) [1/m^2], volume (n,) [m^3] that counts in the
        sums. Raises SolverError, on all ranks, for coincident particles and for particles with too few neighbours.
        """
        metric, uniform = common_metric(self.comm, metric)
        reach = reach_of(self.comm, metric, self.weights.support, positions.shape[1])
        if self.codes is not None:
            raise_together(self.comm, self.codes.too_close(reach.scale * self.weights.support))
        found_by = positions if even is None else even
        self.halo = Halo.plan(self.comm, np.ascontiguousarray(found_by / reach.scale), reach.distance)
        self.particles.attach(self.halo)
        self.positions, self.volume = self.halo.with_ghosts(positions), self.halo.with_ghosts(volume)
        self.even = self.positions if even is None else self.halo.with_ghosts(even)
        self.metric = metric if uniform else self.halo.with_ghosts(metric)
        self._fill_lists(body, reach)
        correction = self.weights.complete(self)
        self.particles.owned_rows("correction")[:] = correction.reshape(self.owned, -1)
        self.particles.owned_rows("pair_volume")[:] = volume
        self.particles.update("reference")

    def _fill_lists(self, body: np.ndarray, reach: Any) -> None:
        self.rim, self.mirror = None, None
        self.fault: str | None = None
        owned, local = self.owned, len(self.positions)
        candidates = plain_candidates(self.even, owned, reach)
        bodies: Any = None
        if self.unbonded is not None or self.codes is not None:
            bodies = self.halo.with_ghosts(body.astype(np.int64))
        if self.unbonded is not None:
            candidates = bonded_only(candidates, bodies, self.unbonded)
        pairs, _ = self._weighed(candidates, 0, owned, *_AS_THEY_STAND)
        self.inner = InnerList(*pairs[:3])
        if maximum(self.comm, self.halo.ghosts):
            self.rim, _ = self._weighed(candidates, owned, local, *_AS_THEY_STAND)
        if self.codes is not None:
            candidates = mirror_candidates(self.even, bodies, owned, self.codes, reach)
            if self.unbonded is not None:
                candidates = bonded_only(candidates, bodies, self.unbonded)
            pairs, code = self._weighed(candidates, 0, local, self.codes.reflections, self.codes.shifts)
            self.mirror = pairs._replace(images=Images(code, self.codes.table(self.space.dimension)))
        raise_together(self.comm, self.fault)

    def _weighed(
        self, candidates: Any, first: int, last: int, reflections: Any, shifts: Any
    ) -> tuple[OneSidedList, np.ndarray]:
        """The candidates in reach whose neighbours have rows first..last-1, without images, and their codes."""
        start, neighbour, code = candidates
        place, support = (self.even, self.metric), self.weights.support
        start, neighbour, code, fault = select_pairs(
            *candidates[:2], *place, support, first, last, code, reflections, shifts
        )
        if fault >= 0:
            self.fault = coincident(self.positions, candidates[0], fault)
        start, neighbour, code = self.weights.kept(self, start, neighbour, code, reflections, shifts)
        pairs = OneSidedList(start, neighbour, self.weights.empty(len(neighbour)), None)
        self.weights.fill(self, pairs, Places(code, reflections, shifts))
        return pairs, code

    def lists(self) -> Iterator[tuple[Any, Places]]:
        """Every list, and where its neighbours stand."""
        for pairs in self._all():
            images = images_of(pairs)
            if images is None:
                yield pairs, Places(np.zeros(len(pairs.neighbour), np.int8), *_AS_THEY_STAND)
            else:
                yield pairs, Places(images.code, self.codes.reflections, self.codes.shifts)

    # --- passes -----------------------------------------------------------------------------------------------

    def gradient(
        self, message: str | None, fields: tuple[Any, ...] = FIELD, sums: np.ndarray | None = None
    ) -> np.ndarray:
        """Add sum_b (v_b - v_a) (x) g_ab of vectors, sum_b (q_b - q_a) g_ab of numbers, to `sums` (`pair_sums` unless
        given).

        message: what the ghosts are sent before, None where they have it; fields: `Vector` and `Scalar` columns of the
        kinematics.
        """
        kinematics = self.particles.storage("kinematics")
        result = self.particles.storage("pair_sums") if sums is None else sums
        add = self._add_gradients

        def apply(pairs: Any) -> None:
            add(self.key(pairs, fields), self.space, pairs, fields, kinematics, result)

        self.sweep(apply, message)
        return result

    def divergence(self, terms: Any = None) -> np.ndarray:
        """Send the records, add the forces of their stresses and of `terms` to `pair_force` [N]."""
        kinematics, record, force = map(self.particles.storage, ("kinematics", "record", "pair_force"))
        add = self._add_forces

        def apply(pairs: Any) -> None:
            add(self.key(pairs, terms), self.space, pairs, terms, kinematics, record, force)

        self.sweep(apply, "record")
        return force

    def key(self, pairs: Any, what: Any) -> tuple[Any, ...]:
        """For `RecalledEach`: which of the lists is swept, and for what."""
        return pairs is self.inner, pairs is self.mirror, what

    def warm(self) -> None:
        """Compile the passes over lists of ghosts, which one rank alone does not have."""
        storage, pairs = self.particles.storage, empty_list(self.inner)
        self._add_gradients.kernel(self.space, pairs, FIELD, storage("kinematics"), storage("pair_sums"))
        self._add_forces.kernel(self.space, pairs, self.terms, *map(storage, ("kinematics", "record", "pair_force")))
