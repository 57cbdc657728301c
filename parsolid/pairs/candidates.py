"""Candidates of pairs: metrics and their reach, and candidates among particles, ghosts and mirror
images."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from decomposition.pair_search import half_pairs
from parsolid.collective import maximum, minimum


@dataclass
class Reach:
    """Coordinates divided by `scale` (d,) bring every interacting pair closer than `distance`."""

    scale: np.ndarray
    distance: float


def metrics(spacing: np.ndarray, axes: np.ndarray | None, smoothing: float) -> np.ndarray:
    """Rows (n, 6) of M = h^{-2}, h = smoothing * spacing along the particle's own axes."""
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


def common_metric(comm: Any, metric: np.ndarray) -> tuple[np.ndarray, bool]:
    """(one row, True) when all particles of all ranks have the same metric to round-off, else (the rows, False);
    collective."""
    low, high = np.full(6, np.inf), np.full(6, -np.inf)
    if len(metric):
        low, high = metric.min(axis=0), metric.max(axis=0)
    low, high = minimum(comm, low), maximum(comm, high)
    if np.all(high - low <= 1e-9 * np.abs(high).max()):
        return low[None, :].copy(), True
    return metric, False


def reach_of(comm: Any, metric: np.ndarray, support: float, dimension: int) -> Reach:
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
    # slightly more than the support, because the distance test rounds differently
    return Reach(scale, support * np.sqrt(maximum(comm, float(largest))) * (1 + 1e-9))


def images_near(
    positions: np.ndarray, body: Any, owned: int, codes: Any, reach: np.ndarray, reference: np.ndarray | None = None
) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    """For each code of `MirrorCodes`: code, rows of owned particles within reach (d,) [m] of its planes, rows of the
    particles that have an image there of their own, and those images (k, d) [m]. reference: positions (n, d) [m] at the
    start, where these are other ones.
    """
    for code in range(len(codes.signs)):
        near = codes.near(positions, body, code, reach, reference)
        givers = np.flatnonzero(near & ~codes.on_planes(positions, code))
        images = codes.images(positions[givers], (positions if reference is None else reference)[givers], code)
        yield code, np.flatnonzero(near[:owned]), givers, images


def mirror_candidates(positions: np.ndarray, body: Any, owned: int, codes: Any, reach: Reach) -> Any:
    """Pairs of owned particles and images near the planes, as (start, neighbour, code), unfiltered by the metric."""
    starts, neighbours, kinds = [], [], []
    nearby = images_near(positions, body, owned, codes, reach.scale * reach.distance)
    for code, receivers, givers, images in nearby:
        points = np.concatenate((positions[receivers], images)) / reach.scale
        start, neighbour = half_pairs(np.ascontiguousarray(points), len(receivers), reach.distance)
        row = np.repeat(np.arange(len(receivers)), np.diff(start))
        across = neighbour >= len(receivers)
        starts.append(receivers[row[across]])
        neighbours.append(givers[neighbour[across] - len(receivers)])
        kinds.append(np.full(across.sum(), code, np.int8))
    receiver, neighbour, kind = (np.concatenate(pieces) for pieces in (starts, neighbours, kinds))
    order = np.lexsort((neighbour, kind, receiver))
    start = np.zeros(owned + 1, np.int64)
    np.cumsum(np.bincount(receiver, minlength=owned), out=start[1:])
    return start, neighbour[order].astype(np.int32), kind[order]


def plain_candidates(positions: np.ndarray, owned: int, reach: Reach) -> Any:
    """Pairs with an owned particle, as (start, neighbour, code), unfiltered by the metric."""
    start, neighbour = half_pairs(np.ascontiguousarray(positions / reach.scale), owned, reach.distance)
    return start, neighbour, np.zeros(len(neighbour), np.int8)


def coincident(positions: np.ndarray, start: np.ndarray, candidate: int) -> str:
    """The fault of two particles at the same place, from their place in the list of candidates."""
    a = int(np.searchsorted(start, candidate, side="right")) - 1
    place = ", ".join(f"{x:.6g}" for x in positions[a])
    return (
        f"bodies: expected no two particles at the same place, found two at ({place}); "
        'bodies that touch must not share nodes: use placement = "cells", or one body'
    )


def bonded_only(candidates: Any, body: np.ndarray, unbonded: Any) -> Any:
    """Candidates (start, neighbour, code) without those of two unbonded bodies, which only contact joins; body (n,):
    with ghosts; unbonded: see `scene.contact.BodyPairs`."""
    start, neighbour, code = candidates
    row = np.repeat(np.arange(len(start) - 1), np.diff(start))
    kept = ~unbonded.between(body[row], body[neighbour])
    before = np.concatenate(([0], np.cumsum(kept)))
    return before[start].astype(np.int64), neighbour[kept], code[kept]
