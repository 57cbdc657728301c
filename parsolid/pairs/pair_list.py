"""Pair lists of a rank's particles, its ghosts and mirror images.

Rows of particles are the owned ones, then ghosts of other ranks, then mirror images. An image has a row, so that sweeps
need no reflections; the methods of `MirrorImages` fill it from the row of its original.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import Halo
from parsolid.collective import raise_together
from parsolid.kernels import inlined, kernel
from parsolid.pairs.candidates import (
    bonded_only,
    coincident,
    common_metric,
    mirror_candidates,
    plain_candidates,
    reach_of,
)

# largest number of different weights in a list with kinds, which have 16 bits
_MOST_KINDS = 1 << 16


class PairList(NamedTuple):
    """Pairs of an owned particle a with neighbours: rows start[a] : start[a + 1] (uint32) of neighbour (m,) uint32 and
    weight (m, 4). Every pair stands once, at the particle with the lower row.

    Weights lie column by column (`weights_of_pairs`): LLVM reads each number of a weight for itself, as sweeps want it,
    only if the next one is not beside it. kind: None, or the row (m,) uint16 of the weight of each pair where few
    weights differ, as on lattices: pairs then take 6 bytes in place of 36.
    """

    start: np.ndarray
    neighbour: np.ndarray
    weight: np.ndarray
    kind: np.ndarray | None = None

    @property
    def weights(self) -> np.ndarray:
        """Weights of all pairs (m, 4)."""
        return self.weight if self.kind is None else self.weight[self.kind]

    def by_kinds(self) -> "PairList":
        """The same list with each different weight once, if these are few; weights are float32."""
        whole_rows = np.ascontiguousarray(self.weight).view(np.complex128).ravel()
        rows, kind = np.unique(whole_rows, return_inverse=True)
        if len(rows) > _MOST_KINDS:
            return self
        weight = weights_of_pairs(len(rows))
        weight[:] = rows.view(np.float32).reshape(-1, 4)
        return self._replace(weight=weight, kind=kind.astype(np.uint16))


def weights_of_pairs(count: int) -> np.ndarray:
    """Zeros (count, 4), column by column in memory."""
    return np.zeros((count, 4), order="F")


@inlined
def weight_row(kind, k):
    """The row of the weight of pair k."""
    if kind is None:
        return k
    return kind[k]


class MirrorImages(NamedTuple):
    """Images of particles in mirror planes and in their edges and corners, (k,) and (k, d).

    source: rows of the originals. With Q (signs) of a vector, R (reflection) of a place, the shift T of the planes and
    a sign s of the stress (stress_sign), the image of a particle has v' = Q v, X' = R X + T, x' = X' + Q (x - X),
    P' L' = s Q P L Q, grad v' = Q grad v R, and symmetric tensors of the reference R S R.
    """

    source: np.ndarray
    signs: np.ndarray
    reflection: np.ndarray
    shift: np.ndarray
    stress_sign: np.ndarray

    def of_places(self, X: np.ndarray) -> np.ndarray:
        """X (local, d) followed by the places of the images."""
        return np.concatenate((X, X[self.source] * self.reflection + self.shift))

    def of_numbers(self, values: np.ndarray) -> np.ndarray:
        """Numbers (local,) followed by those of the images."""
        return np.concatenate((values, values[self.source]))

    def of_vectors(self, values: np.ndarray, signs: np.ndarray) -> np.ndarray:
        """Vectors (local, d) followed by those of the images; signs: `signs` or `reflection`."""
        return np.concatenate((values, values[self.source] * signs))

    def of_tensors(self, values: np.ndarray, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Tensors (local, d, d) followed by those of the images; left, right: `signs` or `reflection`."""
        return np.concatenate((values, values[self.source] * left[:, :, None] * right[:, None]))


@kernel
def within_support(start, neighbour, first, last, positions, metric, support):
    """Candidates of a list with first <= neighbour < last that are within the support: (start, neighbour, the first
    candidate at the same place as its particle or -1)."""
    found, count, same = np.empty(neighbour.size, np.uint32), np.zeros(start.size, np.uint32), -1
    total = 0
    for a in range(start.size - 1):
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            if first <= b < last:
                q = distance_in_support(positions, metric, a, b)
                if q < 1e-9:
                    same = k
                if q < support:
                    found[total] = b
                    total += 1
        count[a + 1] = total
    return count, found[:total].copy(), same


@kernel
def distance_in_support(positions, metric, a, b):
    """q of two particles, q^2 = x . M x with the mean of their metrics; rows (n or 1, 6) 11, 22, 33, 12, 13, 23."""
    last = metric.shape[0] - 1
    M, N = metric[min(a, last)], metric[min(b, last)]
    x, y = positions[a, 0] - positions[b, 0], positions[a, 1] - positions[b, 1]
    z = positions[a, 2] - positions[b, 2] if positions.shape[1] == 3 else 0.0
    straight = (M[0] + N[0]) * x * x + (M[1] + N[1]) * y * y + (M[2] + N[2]) * z * z
    oblique = (M[3] + N[3]) * x * y + (M[4] + N[4]) * x * z + (M[5] + N[5]) * y * z
    return (0.5 * straight + oblique) ** 0.5


class Neighbours:
    """The pairs of a rank's particles within the reach of a kernel.

    halo: ghosts; owned, local, rows: numbers of particles, with ghosts, with images. inner, outer: lists of pairs of
    owned particles, and of those with ghosts and images, with weights still to be filled. Of all rows: positions (rows,
    d) [m], volume (rows,) [m^3] that counts in sums, metric (rows or 1, 6) [1/m^2].
    """

    def __init__(
        self,
        comm: Any,
        codes: Any,
        support: float,
        positions: np.ndarray,
        body: np.ndarray,
        metric: np.ndarray,
        volume: np.ndarray,
        unbonded: Any = None,
    ) -> None:
        """codes: `boundary.mirror_planes.MirrorCodes` or None; positions, body, metric, volume: of owned particles;
        unbonded: bodies that have no pairs, see `scene.contact.BodyPairs`. Collective.

        Raises SolverError on all ranks for two particles at one place, and for planes too close to one another.
        """
        metric, uniform = common_metric(comm, metric)
        reach = reach_of(comm, metric, support, positions.shape[1])
        if codes is not None:
            raise_together(comm, codes.too_close(reach.scale * support))
        self.comm = comm
        self.halo = halo = Halo(comm, np.ascontiguousarray(positions / reach.scale), reach.distance)
        self.owned, self.local = halo.owned, halo.owned + halo.ghosts
        places = halo.with_ghosts(np.ascontiguousarray(positions))
        start, neighbour, code = plain_candidates(places, self.owned, reach)
        bodies: Any = None
        if unbonded is not None or codes is not None:
            bodies = halo.with_ghosts(body.astype(np.int64))
        if unbonded is not None:
            start, neighbour, code = bonded_only((start, neighbour, code), bodies, unbonded)
        images = (np.zeros_like(start), np.zeros(0, np.int32), np.zeros(0, np.int8))
        if codes is not None:
            images = mirror_candidates(places, bodies, self.owned, codes, reach)
            if unbonded is not None:
                images = bonded_only(images, bodies, unbonded)
        self.images, at_images = _images(codes, images, self.local, positions.shape[1])
        self.rows = self.local + len(self.images.source)
        if not uniform:
            metric = halo.with_ghosts(metric)
        if len(self.images.source) and (not uniform or metric[:, 3:].any()):
            metric = _metric_of_images(np.broadcast_to(metric, (self.local, 6)), self.images)
        self.metric = np.ascontiguousarray(metric)
        self.volume = self.images.of_numbers(halo.with_ghosts(volume))
        self.positions = self.images.of_places(places)
        self.inner, fault = self._select(start, neighbour, 0, self.owned, support)
        both = _merged((start, neighbour), (images[0], at_images))
        self.outer, other = self._select(*both, self.owned, self.rows, support)
        raise_together(comm, fault or other)

    def _select(
        self, start: np.ndarray, neighbour: np.ndarray, first: int, last: int, support: float
    ) -> tuple[PairList, str | None]:
        kept, found, same = within_support(start, neighbour, first, last, self.positions, self.metric, support)
        fault = coincident(self.positions, start, same) if same >= 0 else None
        return PairList(kept, found, weights_of_pairs(len(found))), fault

    @property
    def lists(self) -> tuple[PairList, PairList]:
        return self.inner, self.outer

    def with_ghosts_and_images(self, owned: np.ndarray, kind: str) -> np.ndarray:
        """Values of owned particles with those of ghosts and images; kind: "number", "vector" (of the motion), or
        "tensor" and "normal", a tensor and a vector of the reference. Collective."""
        values, images = self.halo.with_ghosts(np.ascontiguousarray(owned)), self.images
        if kind == "number":
            return images.of_numbers(values)
        if kind == "tensor":
            return images.of_tensors(values, images.reflection, images.reflection)
        return images.of_vectors(values, images.signs if kind == "vector" else images.reflection)


def _images(codes: Any, candidates: Any, local: int, d: int) -> tuple[MirrorImages, np.ndarray]:
    """The images in candidates (start, original, code), and the rows (m,) at which the candidates find them."""
    _, source, code = candidates
    key, row = np.unique(code.astype(np.int64) * local + source, return_inverse=True)
    if codes is None:
        none = np.zeros((0, d))
        return MirrorImages(np.zeros(0, np.int64), none, none, none, np.zeros(0)), np.zeros(0, np.int32)
    which, source = np.divmod(key, max(local, 1))
    Q, R, T = (np.ascontiguousarray(table[which, :d]) for table in (codes.signs, codes.reflections, codes.shifts))
    return MirrorImages(source, Q, R, T, codes.stress_signs[which]), (local + row.ravel()).astype(np.int32)


def _merged(first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]) -> tuple[Any, Any]:
    """Two lists (start, neighbour) as one, the neighbours of the second behind."""
    rows = [np.repeat(np.arange(len(start) - 1), np.diff(start)) for start, _ in (first, second)]
    order = np.argsort(np.concatenate(rows), kind="stable")
    return first[0] + second[0], np.concatenate((first[1], second[1]))[order].astype(np.int32)


def _metric_of_images(metric: np.ndarray, images: MirrorImages) -> np.ndarray:
    """Metrics (local, 6) followed by R M R."""
    R = np.ones((len(images.source), 3))
    R[:, : images.reflection.shape[1]] = images.reflection
    mirrored = metric[images.source].copy()
    mirrored[:, 3:] *= R[:, (0, 0, 1)] * R[:, (1, 2, 2)]
    return np.concatenate((metric, mirrored))
