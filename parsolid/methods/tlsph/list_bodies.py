"""Bodies whose particles find their neighbours in pair lists: the sweeps of a step with the messages between ranks."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from parsolid.kernels import kernel
from parsolid.numerics.lanes import aligned_zeros
from parsolid.pairs.list_sweeps import (
    ROWS,
    divergence_in_plane,
    divergence_in_space,
    gradient_in_plane,
    gradient_in_space,
    stress_divergence_in_plane,
    stress_divergence_in_space,
)
from parsolid.pairs.list_weights import ListWeights
from parsolid.pairs.pair_list import Neighbours


class ListBodies:
    """The particles of a rank in rows of some ranges, and what their sweeps read and write (`list_sweeps`).

    waves: 0 without dissipation, 1 with mean impedances, 2 with pressure waves by direction, 3 with both by direction.
    near: lists of pairs; motion, sums, record, fast, slow, force: rows of particles, ghosts and mirror images.
    """

    near: Neighbours

    def __init__(self, comm: Any, particles: Any, weights: ListWeights, codes: Any, waves: int, unbonded: Any) -> None:
        """codes: `boundary.mirror_planes.MirrorCodes` or None; unbonded: see `Neighbours`."""
        self.comm, self.particles, self.weights, self.codes, self.waves = comm, particles, weights, codes, waves
        self.unbonded = unbonded
        self.dimension = particles.owned_rows("position").shape[1]
        self.columns = ROWS[self.dimension]
        self._exchanges: list[Any] = []

    def rebuild(
        self, positions: np.ndarray, body: np.ndarray, metric: np.ndarray, volume: np.ndarray, even: Any = None
    ) -> np.ndarray:
        """Find pairs and their weights; the corrections (owned, d, d). Arguments as in `Neighbours`; collective."""
        for exchange in self._exchanges:
            exchange.free()
        self.particles.detach()
        near = Neighbours(
            self.comm, self.codes, self.weights.support, positions, body, metric, volume, self.unbonded, even
        )
        self.near = near
        self.particles.attach(near.halo)
        correction = self.weights.fill(near)
        at, room = self.columns, (max(near.rows, 1),)
        self.motion, self.sums = aligned_zeros((*room, at.motion)), aligned_zeros((*room, at.sums))
        self.record, self.force = aligned_zeros((*room, at.record)), aligned_zeros((*room, at.force))
        self.fast = aligned_zeros((*room, at.tensor)) if self.waves >= 2 else None
        self.slow = aligned_zeros((*room, at.tensor)) if self.waves == 3 else None
        self.motion[: near.rows, at.reference : at.reference + self.dimension] = near.positions
        told = [self.record if self.waves else self.record[:, : at.gradient]]
        told += [one for one in (self.fast, self.slow) if one is not None]
        self._motion = near.halo.exchange([self.motion[:, : at.reference]])
        self._record = near.halo.exchange(told)
        self._exchanges = [self._motion, self._record]
        return correction

    @property
    def directed_pairs(self) -> int:
        """Interactions counted once a particle."""
        return 2 * len(self.near.inner.neighbour) + len(self.near.outer.neighbour)

    def arrays(self) -> list[np.ndarray]:
        """Arrays that count as memory."""
        rows = [self.motion, self.sums, self.record, self.force, self.fast, self.slow]
        return [*self.near.inner, *self.near.outer, *(one for one in rows if one is not None)]

    def bytes_a_step(self) -> int:
        """Bytes that this rank sends in one evaluation."""
        return self._motion.bytes_sent + self._record.bytes_sent

    def gradient(self, ranges: Sequence[tuple[int, int]], velocity: np.ndarray, position: np.ndarray) -> None:
        """Sums of the velocity gradient; ranges: rows [first, last) that lists concern; velocity, position (d, n)."""
        near, d = self.near, self.dimension
        sweep = gradient_in_space if d == 3 else gradient_in_plane
        for first, last in ranges:
            gather_motion(first, last, velocity, position, self.motion, self.columns.position)
        self._motion.start()
        sweep(near.inner, self.motion, self.sums)
        self._motion.finish()
        if len(near.images.source):
            mirror_motion(near.local, near.images, self.motion, self.columns.position, self.columns.reference)
        sweep(near.outer, self.motion, self.sums)
        clear_rows(near.owned, near.rows, self.sums)

    def divergence(self, ranges: Sequence[tuple[int, int]], stress_force: np.ndarray, dissipative: np.ndarray) -> None:
        """Forces [N] of the records into fields (d, n) at the rows of the ranges."""
        near, at = self.near, self.columns
        self._record.start()
        self._sweep_forces(near.inner)
        self._record.finish()
        if len(near.images.source):
            mirror_records(near.local, near.images, self.record, at.gradient)
            for waves in (self.fast, self.slow):
                if waves is not None:
                    mirror_waves(near.local, near.images, waves)
        self._sweep_forces(near.outer)
        for first, last in ranges:
            scatter_forces(first, last, self.force, stress_force, dissipative, at.force // 2)
        clear_rows(near.owned, near.rows, self.force)

    def _sweep_forces(self, pairs: Any) -> None:
        if self.waves == 0:
            sweep = stress_divergence_in_space if self.dimension == 3 else stress_divergence_in_plane
            sweep(pairs, self.record, self.force)
        else:
            sweep = divergence_in_space if self.dimension == 3 else divergence_in_plane
            sweep(pairs, self.motion, self.record, self.fast, self.slow, self.force)


@kernel
def clear_rows(first, last, rows):
    """Set rows first .. last - 1 to zero."""
    for a in range(first, last):
        for c in range(rows.shape[1]):
            rows[a, c] = 0.0


@kernel
def gather_motion(first, last, velocity, position, motion, at_position):
    """Copy v and x (d, n) of particles first .. last - 1 into their rows."""
    for i in range(velocity.shape[0]):
        v, x = velocity[i], position[i]
        for a in range(first, last):
            motion[a, i] = v[a]
            motion[a, at_position + i] = x[a]


@kernel
def scatter_forces(first, last, force, stress_force, dissipative, at_dissipative):
    """Copy T and D of particles first .. last - 1 into fields (d, n); the rows are zero afterwards."""
    for i in range(stress_force.shape[0]):
        T, D = stress_force[i], dissipative[i]
        for a in range(first, last):
            T[a] = force[a, i]
            D[a] = force[a, at_dissipative + i]
    for a in range(first, last):
        for c in range(force.shape[1]):
            force[a, c] = 0.0


@kernel
def mirror_motion(local, images, motion, at_position, at_reference):
    """v and x of images, in rows from `local` on."""
    for k in range(images.source.size):
        a, b = local + k, images.source[k]
        for i in range(images.signs.shape[1]):
            Q = images.signs[k, i]
            motion[a, i] = Q * motion[b, i]
            displacement = motion[b, at_position + i] - motion[b, at_reference + i]
            motion[a, at_position + i] = motion[a, at_reference + i] + Q * displacement


@kernel
def mirror_records(local, images, record, at_gradient):
    """Stresses, gradients and impedances of images, in rows from `local` on."""
    d = images.signs.shape[1]
    stride = 4 if d == 3 else 2
    for k in range(images.source.size):
        a, b, s = local + k, images.source[k], images.stress_sign[k]
        for c in range(record.shape[1]):
            record[a, c] = record[b, c]
        for j in range(d):
            for i in range(d):
                record[a, stride * j + i] *= s * images.signs[k, i] * images.signs[k, j]
                record[a, at_gradient + stride * j + i] *= images.signs[k, i] * images.reflection[k, j]


@kernel
def mirror_waves(local, images, waves):
    """Wave tensors of images, in rows from `local` on: R S R."""
    for k in range(images.source.size):
        a, b, R = local + k, images.source[k], images.reflection[k]
        for c in range(waves.shape[1]):
            waves[a, c] = waves[b, c]
        if R.size == 3:
            waves[a, 4] *= R[0] * R[1]
            waves[a, 5] *= R[0] * R[2]
            waves[a, 6] *= R[1] * R[2]
        else:
            waves[a, 2] *= R[0] * R[1]
