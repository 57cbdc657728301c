"""Bonds of the peridynamic methods: halo, radial pair lists, shape tensors on the surviving bonds, mirror images."""

from dataclasses import dataclass

import numpy as np

from decomposition.halo import Halo
from parsolid.boundary.mirror_planes import MirrorCodes
from parsolid.collective import maximum, raise_together
from parsolid.pairs import radial_weights as bond_weights
from parsolid.pairs import weights
from parsolid.pairs.candidates import (
    IDENTITY,
    coincident,
    common_metric,
    mirror_candidates,
    plain_candidates,
    reach_of,
)
from parsolid.pairs.layout import Images, PairList
from parsolid.pairs.lists import InnerList, OneSidedList, Places


@dataclass
class BondSystem:
    """A rank's bonds: inner (both owned), rim (neighbour is a ghost), mirror (neighbour is an image), and their halo.

    Weights are w(|xi|) V_a V_b, 0 for a broken bond. positions (n, d) [m], identifier (n,), volume (n,) [m^3] with ghosts
    behind; a bar lies in the plane. Of owned particles: inverse_shape, initial_inverse_shape (owned, d, d), K^{-1} now and
    with all bonds whole; determinant, initial_determinant (owned,) of K.
    """

    halo: Halo
    inner: PairList
    rim: PairList | None
    mirror: PairList | None
    images: Images | None
    positions: np.ndarray
    identifier: np.ndarray
    volume: np.ndarray
    metric: np.ndarray
    codes: MirrorCodes | None
    bar: bool

    def __post_init__(self):
        owned, d = self.halo.owned, self.positions.shape[1]
        self.inverse_shape, self.determinant = np.zeros((owned, d, d)), np.zeros(owned)
        self.refresh_shape()
        self.initial_inverse_shape, self.initial_determinant = self.inverse_shape.copy(), self.determinant.copy()

    @property
    def owned(self) -> int:
        """Particles of this rank."""
        return self.halo.owned

    @property
    def directed_pairs(self) -> int:
        """Bonds counted once a particle, over this rank's particles, the broken ones too."""
        return 2 * len(self.inner.neighbour) + sum(len(p.neighbour) for p in (self.rim, self.mirror) if p is not None)

    def lists(self):
        """(pairs, images or None, both sides receive, code, reflections, shifts) of every list."""
        for pairs, both in ((self.inner, True), (self.rim, False)):
            if pairs is not None:
                yield pairs, None, both, np.zeros(len(pairs.neighbour), np.int8), *IDENTITY
        if self.mirror is not None:
            yield self.mirror, self.images, False, self.images.code, self.codes.reflections, self.codes.shifts

    def refresh_shape(self, particles: np.ndarray | None = None) -> None:
        """K and K^{-1} of owned particles (all unless given) on the surviving bonds; sums in an order that never changes."""
        n, d = self.positions.shape
        shape, chosen = np.zeros((n, d, d)), np.zeros(n, bool)
        chosen[slice(None) if particles is None else particles] = True
        for pairs, _, both, code, reflections, shifts in self.lists():
            kind = InnerList(*pairs) if both else OneSidedList(*pairs, None)
            bond_weights.add_shapes(chosen, kind, Places(code, reflections, shifts), self.positions, shape)
        bond_weights.invert_shapes(
            chosen, self.bar, self.owned, self.volume, shape, self.inverse_shape, self.determinant
        )


class _Builder:
    """Fills radial weights for one rank's lists over shared particle arrays."""

    def __init__(self, influence, positions, metric, volume):
        self.influence, self.positions, self.metric, self.volume = influence, positions, metric, volume
        self.fault = None

    def bonds(self, start, neighbour, first, last, code, reflections, shifts) -> tuple[PairList, np.ndarray]:
        """The candidates within the horizon with their weights, and the codes of their images."""
        start, neighbour, code, place = weights.select_pairs(
            start,
            neighbour,
            self.positions,
            self.metric,
            self.influence.support,
            first,
            last,
            code,
            reflections,
            shifts,
        )
        if place >= 0:
            self.fault = coincident(self.positions, start, place)
        pairs = PairList(start, neighbour, np.empty(len(neighbour)))
        places = Places(code, reflections, shifts)
        bond_weights.bond_weights(self.influence, InnerList(*pairs), places, self.positions, self.metric, self.volume)
        return pairs, code


def embedded(array: np.ndarray) -> np.ndarray:
    """Vectors (n, 1) of a bar as (n, 2), in the plane; others as they are."""
    return np.pad(array, ((0, 0), (0, 1))) if array.shape[1] == 1 else array


def build_bond_system(
    comm, influence, horizon: np.ndarray, particle_set, volume: np.ndarray, codes: MirrorCodes | None
) -> BondSystem:
    """Plan ghosts and build every list; collective.

    influence: of `bond_weights.INFLUENCES`; horizon (n,) [m], a bond's is that of the mean metric 1/delta^2; particle_set: this rank's
    particles; volume (n,) [m^3] that counts in the pair sums.
    Raises SolverError, on all ranks, for coincident particles and for one whose bonds do not span space.
    """
    bar = particle_set.position.shape[1] == 1
    positions = embedded(particle_set.position)
    metric = np.zeros((len(positions), 6))
    metric[:, :3] = 1.0 / horizon[:, None] ** 2
    if positions.shape[1] == 2:
        metric[:, 2] = 1.0
    metric, uniform = common_metric(comm, metric)
    reach = reach_of(comm, metric, influence.support, positions.shape[1])
    if codes is not None:
        raise_together(comm, codes.too_close(reach.scale))
    halo = Halo.plan(comm, np.ascontiguousarray(positions / reach.scale), reach.distance)
    place, V = halo.with_ghosts(positions), halo.with_ghosts(volume)
    full_metric = metric if uniform else halo.with_ghosts(metric)
    build = _Builder(influence, place, full_metric, V)
    start, neighbour, plain = plain_candidates(place, halo.owned, reach)
    inner, _ = build.bonds(start, neighbour, 0, halo.owned, plain, *IDENTITY)
    rim = mirror = images = None
    if maximum(comm, halo.ghosts):
        rim, _ = build.bonds(start, neighbour, halo.owned, len(place), plain, *IDENTITY)
    if codes is not None:
        candidates = mirror_candidates(
            place, halo.with_ghosts(particle_set.body.astype(np.int64)), halo.owned, codes, reach
        )
        mirror, code = build.bonds(*candidates[:2], 0, len(place), candidates[2], codes.reflections, codes.shifts)
        images = Images(code, codes.table(positions.shape[1]))
    raise_together(comm, build.fault)
    identifier = halo.with_ghosts(particle_set.identifier)
    result = BondSystem(halo, inner, rim, mirror, images, place, identifier, V, full_metric, codes, bar)
    raise_together(comm, _unsupported(result))
    return result


def _unsupported(bond_system: BondSystem) -> str | None:
    """Names the first particle whose bonds do not span space."""
    flat = ~bond_system.inverse_shape.any(axis=(1, 2))
    if not flat.any():
        return None
    place = ", ".join(f"{x:.6g}" for x in bond_system.positions[np.argmax(flat)])
    return f"method.horizon_ratio: expected bonds in every direction at every particle, found too few at ({place})"
