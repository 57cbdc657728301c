"""Set-up shared by the pair methods: metrics, halo, pair lists with weights, corrections and mirror images."""

from dataclasses import dataclass

import numpy as np

from decomposition.halo import Halo
from decomposition.neighbours import half_pairs
from parsolid.boundary.mirror_planes import MirrorCodes
from parsolid.collective import maximum, minimum, raise_together
from parsolid.numerics.lanes import aligned_zeros
from parsolid.pairs import weights
from parsolid.pairs.closure import Closure, close
from parsolid.pairs.layout import Images, PairList


@dataclass
class Reach:
    """Coordinates divided by `scale` (d,) bring every interacting pair closer than `distance`."""

    scale: np.ndarray
    distance: float


def metrics(spacing: np.ndarray, axes: np.ndarray | None, smoothing: float) -> np.ndarray:
    """Rows (n, 6) of M = h^{-2}, h = smoothing * spacing along the particle's own axes (see `pairs.weights`)."""
    n, d = spacing.shape
    diagonal = np.ones((n, 3))
    diagonal[:, :d] = 1.0 / (smoothing * spacing) ** 2
    result = np.zeros((n, 6))
    if axes is None:
        result[:, :3] = diagonal
        return result
    frame = np.tile(np.eye(3), (n, 1, 1))
    frame[:, :d, :d] = axes
    M = np.einsum("nki,nk,nkj->nij", frame, diagonal, frame)
    result[:, :3] = M[:, (0, 1, 2), (0, 1, 2)]
    result[:, 3:] = M[:, (0, 0, 1), (1, 2, 2)]
    return result


def common_metric(comm, metric: np.ndarray) -> tuple[np.ndarray, bool]:
    """(one row, True) when all particles of all ranks have the same metric to round-off, else (the rows, False); collective."""
    low, high = np.full(6, np.inf), np.full(6, -np.inf)
    if len(metric):
        low, high = metric.min(axis=0), metric.max(axis=0)
    low, high = minimum(comm, low), maximum(comm, high)
    if np.all(high - low <= 1e-9 * np.abs(high).max()):
        return low[None, :].copy(), True
    return metric, False


def reach_of(comm, metric: np.ndarray, support: float, dimension: int) -> Reach:
    """Scaled coordinates in which the widest of all supports is about a sphere."""
    M = np.zeros((len(metric), 3, 3))
    M[:, (0, 1, 2), (0, 1, 2)] = metric[:, :3]
    M[:, (0, 0, 1), (1, 2, 2)] = M[:, (1, 2, 2), (0, 0, 1)] = metric[:, 3:]
    extent = np.linalg.inv(M)[:, :dimension, :dimension]
    diagonal = np.arange(dimension)
    scale = np.sqrt(extent[:, diagonal, diagonal].max(axis=0, initial=0.0))
    scale = maximum(comm, scale)
    scaled = extent / np.outer(scale, scale)
    largest = np.linalg.eigvalsh(scaled)[:, -1].max(initial=0.0)
    # a hair more than the support, because the distance test repeats in other arithmetic
    return Reach(scale, support * np.sqrt(maximum(comm, float(largest))) * (1 + 1e-9))


@dataclass
class NeighbourLists:
    """A rank's pair lists: inner (both owned), rim (neighbour is a ghost), mirror (neighbour is an image), and their halo."""

    halo: Halo
    inner: PairList
    rim: PairList | None
    mirror: PairList | None
    images: Images | None
    correction: np.ndarray
    metric: np.ndarray
    volume: np.ndarray
    positions: np.ndarray

    @property
    def directed_pairs(self) -> int:
        """Interactions counted once a particle, over this rank's particles."""
        return 2 * len(self.inner.neighbour) + sum(len(p.neighbour) for p in (self.rim, self.mirror) if p is not None)


IDENTITY = (np.ones((1, 3)), np.zeros((1, 3)))


def mirror_candidates(positions, body, owned, codes: MirrorCodes, reach: Reach):
    """Pairs of owned particles and images near the planes, as (start, neighbour, code), unfiltered by the metric."""
    starts, neighbours, kinds = [], [], []
    for code in range(len(codes.signs)):
        near = codes.near(positions, body, code, reach.scale * reach.distance)
        apart = near & ~codes.on_planes(positions, code)
        receivers = np.flatnonzero(near[:owned])
        givers = np.flatnonzero(apart)
        d = positions.shape[1]
        images = positions[givers] * codes.reflections[code, :d] + codes.shifts[code, :d]
        points = np.concatenate((positions[receivers], images)) / reach.scale
        start, neighbour = half_pairs(np.ascontiguousarray(points), len(receivers), reach.distance)
        row = np.repeat(np.arange(len(receivers)), np.diff(start))
        across = neighbour >= len(receivers)
        starts.append(receivers[row[across]])
        neighbours.append(givers[neighbour[across] - len(receivers)])
        kinds.append(np.full(across.sum(), code, np.int8))
    receiver, neighbour, kind = (np.concatenate(parts) for parts in (starts, neighbours, kinds))
    order = np.lexsort((neighbour, kind, receiver))
    start = np.zeros(owned + 1, np.int64)
    np.cumsum(np.bincount(receiver, minlength=owned), out=start[1:])
    return start, neighbour[order].astype(np.int32), kind[order]


def plain_candidates(positions, owned: int, reach: Reach):
    """Pairs with an owned particle, as (start, neighbour, code), unfiltered by the metric."""
    start, neighbour = half_pairs(np.ascontiguousarray(positions / reach.scale), owned, reach.distance)
    return start, neighbour, np.zeros(len(neighbour), np.int8)


def coincident(positions, start, candidate: int) -> str:
    """The fault of two particles at the same place, from their place in the list of candidates."""
    a = int(np.searchsorted(start, candidate, side="right")) - 1
    place = ", ".join(f"{x:.6g}" for x in positions[a])
    return (
        f"bodies: expected no two particles at the same place, found two at ({place}); "
        'bodies that touch must not share nodes: use placement = "cells", or one body'
    )


class _Builder:
    """Fills weights for one rank's lists over shared particle arrays."""

    def __init__(self, kernel, positions, metric, volume):
        self.kernel, self.positions, self.metric, self.volume = kernel, positions, metric, volume
        self.dimension = positions.shape[1]
        self.fault = None

    def select(self, start, neighbour, first, last, code, reflections, shifts):
        result = weights.select_pairs(
            start, neighbour, self.positions, self.metric, self.kernel.support, first, last, code, reflections, shifts
        )
        if result[3] >= 0:
            self.fault = coincident(self.positions, start, result[3])
        return result[:3]

    def weigh(self, start, neighbour, code, reflections, shifts) -> PairList:
        pairs = PairList(start, neighbour, aligned_zeros((len(neighbour), 4)))
        weights.pair_weights(
            self.kernel,
            self.dimension,
            start,
            neighbour,
            code,
            reflections,
            shifts,
            self.positions,
            self.metric,
            self.volume,
            pairs.weight,
        )
        return pairs


def build_neighbour_lists(
    comm, kernel, positions, body, metric, volume, codes: MirrorCodes | None, factor: float, surface=None
) -> NeighbourLists:
    """Plan ghosts and build every list; collective.

    positions (n, d) [m], body (n,), metric (n, 6) [1/m^2], volume (n,) [m^3] of owned particles; factor scales the
    dissipation. With surface = (area vectors (n, d) [m^2], parts of the particles on this side of planes (n,)) the weights
    are closed, see `pair_correction`.
    Raises SolverError, on all ranks, for coincident particles and for a particle without neighbours.
    """
    dimension, owned = positions.shape[1], len(positions)
    metric, uniform = common_metric(comm, metric)
    reach = reach_of(comm, metric, kernel.support, dimension)
    if codes is not None:
        raise_together(comm, codes.too_close(reach.scale * kernel.support))
    halo = Halo.plan(comm, np.ascontiguousarray(positions / reach.scale), reach.distance)
    place, V = halo.with_ghosts(positions), halo.with_ghosts(volume)
    full_metric = metric if uniform else halo.with_ghosts(metric)
    build = _Builder(kernel, place, full_metric, V)
    start, neighbour, plain = plain_candidates(place, owned, reach)
    inner = build.weigh(*build.select(start, neighbour, 0, owned, plain, *IDENTITY), *IDENTITY)
    rim = mirror = images = None
    if halo.ghosts:
        rim = build.weigh(*build.select(start, neighbour, owned, len(place), plain, *IDENTITY), *IDENTITY)
    del start, neighbour, plain
    if codes is not None:
        start, neighbour, code = mirror_candidates(place, halo.with_ghosts(body.astype(np.int64)), owned, codes, reach)
        selected = build.select(start, neighbour, 0, len(place), code, codes.reflections, codes.shifts)
        mirror = build.weigh(*selected, codes.reflections, codes.shifts)
        images = Images(selected[2], codes.table(dimension))
    raise_together(comm, build.fault)
    neighbour_lists = NeighbourLists(halo, inner, rim, mirror, images, None, full_metric, V, place)
    lists = list(_lists(neighbour_lists, codes))
    _correct(neighbour_lists, lists)
    if surface is not None:
        close(Closure(halo, lists, place, *surface), neighbour_lists, lambda: _correct(neighbour_lists, lists))
    for pairs, _, code, reflections, _ in lists:
        weights.jump_factors(
            factor, pairs.start, pairs.neighbour, code, reflections, neighbour_lists.correction, pairs.weight
        )
    return neighbour_lists


def _lists(neighbour_lists: NeighbourLists, codes):
    """(pairs, both sides receive, code, reflections, shifts) of every list."""
    for pairs, both in ((neighbour_lists.inner, True), (neighbour_lists.rim, False)):
        if pairs is not None:
            yield pairs, both, np.zeros(len(pairs.neighbour), np.int8), *IDENTITY
    if neighbour_lists.mirror is not None:
        yield neighbour_lists.mirror, False, neighbour_lists.images.code, codes.reflections, codes.shifts


def _correct(neighbour_lists: NeighbourLists, lists) -> None:
    """Corrections L_a (71) of owned particles and ghosts; collective."""
    n, d = neighbour_lists.positions.shape
    owned = neighbour_lists.halo.owned
    moment = np.zeros((n, d, d))
    for pairs, both, code, reflections, shifts in lists:
        weights.add_moments(
            both,
            pairs.start,
            pairs.neighbour,
            code,
            reflections,
            shifts,
            neighbour_lists.positions,
            pairs.weight,
            moment,
        )
    correction = np.zeros((n, d, d))
    raise_together(neighbour_lists.halo.comm, _lonely(moment[:owned], neighbour_lists.positions))
    correction[:owned] = _inverse(moment[:owned] / neighbour_lists.volume[:owned, None, None])
    flat = correction.reshape(n, d * d)
    neighbour_lists.halo.update([flat])
    neighbour_lists.correction = flat.reshape(n, d, d)


def _lonely(moment: np.ndarray, positions: np.ndarray) -> str | None:
    """Names the first particle that no other reaches."""
    alone = ~moment.any(axis=(1, 2))
    if not alone.any():
        return None
    place = ", ".join(f"{x:.6g}" for x in positions[np.argmax(alone)])
    return f"method.smoothing: expected every particle to have a neighbour, found none for that at ({place})"


def _inverse(moment: np.ndarray) -> np.ndarray:
    """Inverse of each moment (n, d, d); where neighbours do not span space (a single layer), the pseudo-inverse."""
    d = moment.shape[1]
    scale = np.abs(moment).max(axis=(1, 2), initial=0.0)
    good = np.abs(np.linalg.det(moment)) > 1e-8 * scale**d
    result = np.empty_like(moment)
    result[good] = np.linalg.inv(moment[good])
    result[~good] = np.linalg.pinv(moment[~good], rcond=1e-6)
    return result
