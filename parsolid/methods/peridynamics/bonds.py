"""Bonds of a rank's particles: lists, weights and shape tensors; `sweeps` goes over them.

A bond joins particles closer than the horizon delta, that of the mean of 1/delta^2 of both. With the influence w(q),
q = |xi|/delta, its weight is w V_a V_b, and the shape tensor K_a = sum_b w V_b xi (x) xi. All arrays have ghosts behind
the owned particles. A bar lies in the plane, with K_11 alone.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from decomposition.halo import Halo
from parsolid.collective import maximum, raise_together
from parsolid.kernels import kernel
from parsolid.methods.peridynamics.sweeps import MATRIX_ROW, BondList, BondSweeps, Images, Lists
from parsolid.pairs.candidates import bonded_only, coincident, mirror_candidates, plain_candidates, reach_of
from parsolid.particles.declaration import Columns, Field, Rows
from parsolid.tensors import determinant_symmetric, inverse_symmetric

# w(q), at most 1
INFLUENCES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "constant": np.ones_like,
    "linear": lambda q: 1.0 - q,
    "cubic-spline": lambda q: np.where(q < 0.5, 1.0 - 6.0 * q * q * (1.0 - q), 2.0 * (1.0 - q) ** 3),
}
# the determinant of a shape tensor over that of a multiple of 1 below which its bonds do not span space
_FLAT = 1e-9


class Bonds(BondSweeps):
    """All bonds of a rank's particles; d = 2 or 3, 2 for bars, too.

    volume (n,) [m^3]; horizon (owned,) [m]; determinant (owned,) of K [m^10, in the plane m^8].

    It declares inverse_shape, K^-1 as 11, 22, 33, 12, 13, 23, zero where the bonds do not span space or bear no stress;
    and bond_stress, the rows of M, which ghosts have with the message "record".
    """

    def __init__(self, comm: Any, particles: Any, settings: Any, particle_set: Any, conditions: Any) -> None:
        """conditions: with the reflections of mirror planes, and the part of each particle on this side of these, whose
        whole counts in the sums. Collective. Raises SolverError, on all ranks, for
        coincident particles and for one whose bonds do not span space.
        """
        self.comm, self.particles, self.codes = comm, particles, conditions.codes
        self.bar, self.owned = particle_set.position.shape[1] == 1, len(particle_set)
        self.d = d = max(2, particle_set.position.shape[1])
        self.influence = settings.influence
        self.horizon = np.array([settings.horizon(spacing) for spacing in particle_set.spacing.max(axis=1)])
        columns: dict[str, Any] = {"layout": Columns()}
        particles.declare(Field("inverse_shape", 6, "1/m^5", carried=False, **columns))
        self._find(particle_set, conditions.share, conditions.scene.unbonded)
        row = MATRIX_ROW[d]
        told: dict[str, Any] = {"ghosts": "forward", "message": "record"}
        particles.declare(Field("bond_stress", row, "", layout=Rows(row), carried=False, **told))
        particles.update("reference")
        self.begin_sweeps()
        self.determinant = np.zeros(self.owned)
        self.refresh_shapes(np.ones(self.owned, bool), self.lists)
        flat, fault = ~particles.owned_rows("inverse_shape").any(axis=1), None
        if flat.any():
            place = ", ".join(f"{x:.6g}" for x in self.positions[np.argmax(flat)])
            expected = "bonds in every direction at every particle"
            fault = f"method.horizon_ratio: expected {expected}, found too few at ({place})"
        raise_together(comm, fault)

    # --- lists ------------------------------------------------------------------------------------------------

    def _find(self, particle_set: Any, share: np.ndarray, unbonded: Any) -> None:
        """Plan ghosts and make every list."""
        X = np.pad(particle_set.position, ((0, 0), (0, self.d - particle_set.position.shape[1])))
        metric = np.zeros((self.owned, 6))
        metric[:, :3] = 1.0 / self.horizon[:, None] ** 2
        reach = reach_of(self.comm, metric, 1.0, self.d)
        if self.codes is not None:
            raise_together(self.comm, self.codes.too_close(reach.scale))
        self.halo = Halo(self.comm, np.ascontiguousarray(X / reach.scale), reach.distance)
        self.particles.attach(self.halo)
        self.positions, self.volume = self.halo.with_ghosts(X), self.halo.with_ghosts(particle_set.volume / share)
        inverse_square = self.halo.with_ghosts(metric[:, 0].copy())
        owned, local = self.owned, len(self.positions)
        fault: list[str] = []
        body = self.halo.with_ghosts(particle_set.body.astype(np.int64))

        def bonded(candidates: Any, first: int, last: int, R: np.ndarray, T: np.ndarray) -> tuple[BondList, np.ndarray]:
            """Candidates in reach whose neighbours have rows first .. last - 1, and their codes."""
            start, neighbour, code = candidates if unbonded is None else bonded_only(candidates, body, unbonded)
            neighbour = neighbour.astype(np.uint32)
            q = np.empty(len(neighbour))
            measure(start, neighbour, code, self.positions, inverse_square, R, T, q)
            kept = (q < 1.0) & (neighbour >= first) & (neighbour < last)
            same = (q < 1e-9) & kept & (neighbour != np.repeat(np.arange(owned), np.diff(start)))
            if same.any():
                fault.append(coincident(self.positions, start, int(np.argmax(same))))
            before = np.concatenate(([0], np.cumsum(kept)))
            start, neighbour, code, q = before[start].astype(np.int64), neighbour[kept], code[kept], q[kept]
            row = np.repeat(np.arange(owned), np.diff(start))
            # the product of the volumes first, so that it rounds alike from both ends
            weight = INFLUENCES[self.influence](q) * (self.volume[row] * self.volume[neighbour])
            return BondList(start, neighbour, weight), code

        as_they_stand = np.ones((1, 4)), np.zeros((1, 4))
        candidates = plain_candidates(self.positions, owned, reach)
        self.inner, _ = bonded(candidates, 0, owned, *as_they_stand)
        if maximum(self.comm, self.halo.ghosts):
            self.rim, _ = bonded(candidates, owned, local, *as_they_stand)
        if self.codes is not None:
            codes = self.codes
            Q, R, T = (rows_in(array, self.d) for array in (codes.signs, codes.reflections, codes.shifts))
            candidates = mirror_candidates(self.positions, body, owned, self.codes, reach)
            self.mirror, code = bonded(candidates, 0, local, R, T)
            self.images = Images(code, Q, R, T)
        raise_together(self.comm, fault[0] if fault else None)

    @property
    def directed_pairs(self) -> int:
        return sum((2 if mutual else 1) * len(bonds.neighbour) for bonds, _, mutual in self.lists)

    def arrays(self) -> list[np.ndarray]:
        kept = [array for bonds, images, _ in (*self.lists, *self.missing) for array in (*bonds, *(images or ()))]
        return [*kept, self.sums, *self.motion.values(), *(self.lattice.arrays() if self.lattice else ())]

    # --- shape tensors ----------------------------------------------------------------------------------------

    def refresh_shapes(self, chosen: np.ndarray, lists: Lists) -> None:
        """K^-1 and det K of chosen (owned,) particles from the bonds that are left, summed in an order that never
        changes; lists: with all of their bonds."""
        shape = np.zeros((len(self.positions), 6))
        mask = np.concatenate((chosen, np.zeros(len(self.positions) - self.owned, bool)))
        for bonds, images, mutual in lists:
            add_shapes(mask, bonds, images, mutual, self.positions, shape)
        spans = 1 if self.bar else self.d
        inverse = self.particles.storage("inverse_shape")
        invert_shapes(chosen, spans, self.volume, shape, inverse, self.determinant)

    def inverse_shapes(self) -> np.ndarray:
        """K^-1 (owned, d, d)."""
        six = self.particles.owned_rows("inverse_shape")
        return np.stack([six[:, (0, 3, 4)], six[:, (3, 1, 5)], six[:, (4, 5, 2)]], axis=1)[:, : self.d, : self.d]


def rows_in(array: np.ndarray, d: int) -> np.ndarray:
    """The first d columns of an array, padded to four with zeros."""
    return np.pad(array[:, :d], ((0, 0), (0, 4 - d)))


@kernel
def measure(start, neighbour, code, positions, inverse_square, R, T, q):
    """Fill q (m,) = |xi|/delta of candidate pairs; inverse_square (n,): 1/delta^2; R, T: rows of images by code."""
    for a in range(start.shape[0] - 1):
        for k in range(start[a], start[a + 1]):
            b, c, square = neighbour[k], code[k], 0.0
            for i in range(positions.shape[1]):
                x = positions[a, i] - (R[c, i] * positions[b, i] + T[c, i])
                square += x * x
            q[k] = (square * 0.5 * (inverse_square[a] + inverse_square[b])) ** 0.5


@kernel
def add_shapes(chosen, bonds, images, mutual, positions, shape):
    """Add V_a K_a of chosen (n,) particles that receive to shape (n, 6), as 11, 22, 33, 12, 13, 23."""
    d = positions.shape[1]
    for a in range(bonds.start.shape[0] - 1):
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b, w = bonds.neighbour[k], bonds.weight[k]
            if not (chosen[a] or (mutual is not None and chosen[b])):
                continue
            x, y, z = positions[b, 0], positions[b, 1], positions[b, 2] if d == 3 else 0.0
            if images is not None:
                R, T = images.reflections[images.code[k]], images.shifts[images.code[k]]
                x, y, z = R[0] * x + T[0], R[1] * y + T[1], R[2] * z + T[2]
            x, y, z = x - positions[a, 0], y - positions[a, 1], z - positions[a, 2] if d == 3 else 0.0
            terms = (w * x * x, w * y * y, w * z * z, w * x * y, w * x * z, w * y * z)
            for c in range(6):
                if chosen[a]:
                    shape[a, c] += terms[c]
                if mutual is not None and chosen[b]:
                    shape[b, c] += terms[c]


@kernel
def invert_shapes(chosen, spans, volume, shape, inverse, determinant):
    """K^-1 into inverse (6, n) and det K of chosen (owned,) particles, K of which the first `spans` axes count.

    The inverse is zero where bonds do not span space: where det K is small beside the mean diagonal's power.
    """
    for a in range(chosen.shape[0]):
        if not chosen[a]:
            continue
        K = (shape[a, 0] / volume[a], shape[a, 1] / volume[a] if spans > 1 else 1.0,
             shape[a, 2] / volume[a] if spans > 2 else 1.0, shape[a, 3] / volume[a] if spans > 1 else 0.0,
             shape[a, 4] / volume[a] if spans > 2 else 0.0, shape[a, 5] / volume[a] if spans > 2 else 0.0)  # fmt: skip
        mean = (K[0] + (K[1] if spans > 1 else 0.0) + (K[2] if spans > 2 else 0.0)) / spans
        determinant[a] = determinant_symmetric(K)
        for c in range(6):
            inverse[c, a] = 0.0
        if determinant[a] > _FLAT * mean**spans:
            L = inverse_symmetric(K)
            inverse[0, a] = L[0]
            if spans > 1:
                inverse[1, a], inverse[3, a] = L[1], L[3]
            if spans > 2:
                inverse[2, a], inverse[4, a], inverse[5, a] = L[2], L[4], L[5]
