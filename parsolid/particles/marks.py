"""Which particles of lattices are in regions with a name, and how much of their surface is."""

import itertools
from collections.abc import Mapping

import numpy as np

from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.named_regions import Region

# of a spacing: how far from a region a place may be by rounding
TOLERANCE = 1e-6
# of a spacing: how far from a face it is decided on which side of it a region lies
_TOUCHING = 1e-4


def mark_lattice(piece: ParticleSet, known: Mapping[str, Region], nodes: bool) -> None:
    """Set `regions` and `surfaces` of a piece of a lattice; nodes: particles are on the surface, not half a spacing
    within.

    A face counts as far as the quarters of it are in the region.
    """
    count, d = piece.position.shape
    tolerance = TOLERANCE * piece.spacing.min(axis=1, initial=np.inf)
    axes = np.broadcast_to(np.eye(d), (count, d, d)) if piece.axes is None else piece.axes
    area = np.einsum("nki,ni->nk", axes, piece.area)
    held = [_contained(region, piece.position, tolerance, known) for region in known.values()]
    surfaces = np.zeros((count, len(known), d))
    for k in range(d):
        rows = np.flatnonzero(area[:, k])
        share = _shares(piece, rows, axes[rows], np.sign(area[rows]), k, known, nodes)
        surfaces[rows] += share[:, :, None] * (area[rows, k, None] * axes[rows, k])[:, None, :]
    piece.regions = (np.stack(held, axis=1) | surfaces.any(axis=2)).astype(np.int64)
    piece.surfaces = surfaces.reshape(count, len(known) * d)


def _contained(region: Region, places: np.ndarray, tolerance: np.ndarray, known: Mapping[str, Region]) -> np.ndarray:
    return region.contains(places, tolerance, known, lambda name: np.zeros(len(places), bool))


def _shares(
    piece: ParticleSet,
    rows: np.ndarray,
    axes: np.ndarray,
    sides: np.ndarray,
    normal: int,
    known: Mapping[str, Region],
    nodes: bool,
) -> np.ndarray:
    """Which part (k, regions) of the faces of particles at rows across an own axis is in each region; sides (k, d)."""
    spacing, d = piece.spacing[rows], sides.shape[1]
    tolerance = TOLERANCE * spacing.min(axis=1, initial=np.inf)
    depth = 0.0 if nodes else 0.5
    middle = piece.position[rows] + (depth * sides[:, normal] * spacing[:, normal])[:, None] * axes[:, normal]
    within, total = np.zeros((len(rows), len(known))), np.zeros(len(rows))
    along = [k for k in range(d) if k != normal]
    for signs in itertools.product((-1.0, 1.0), repeat=d - 1):
        places, there = middle.copy(), np.ones(len(rows), bool)
        for k, sign in zip(along, signs):
            places += (0.25 * sign * spacing[:, k])[:, None] * axes[:, k]
            # a node at an edge has no face beyond it
            there &= ~(nodes & (sides[:, k] == sign))
        total += there
        outward = (_TOUCHING * spacing[:, normal] * sides[:, normal])[:, None] * axes[:, normal]
        for number, region in enumerate(known.values()):
            inside = there & _contained(region, places, tolerance, known)
            if not nodes:
                # a face that a region touches from outside alone is not its face; one in a plane region is
                beyond = _contained(region, places + outward, tolerance, known)
                inside &= ~beyond | _contained(region, places - outward, tolerance, known)
            within[:, number] += inside
    return within / np.maximum(total, 1.0)[:, None]
