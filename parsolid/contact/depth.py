"""How deep each particle lies in its own body in the reference: the threshold of the other body's colour follows."""

from typing import Any

import numpy as np

from decomposition.halo import Halo
from decomposition.pair_search import ClosePairs
from parsolid.collective import maximum, raise_together
from parsolid.contact.body_pairs import BodyPair, BodyPairs, reflections, shares_of
from parsolid.contact.kernel import norm, over_planes, shape
from parsolid.kernels import kernel
from parsolid.methods.protocol import ParticleSystem

# penetration at the start that is refused, in the smaller spacing
_TOO_DEEP = 1.0


@kernel
def add_colours(place, volume, start, neighbour, owned, per_reach, total):
    """Add V_b shape(|X_a - X_b|/R) to both ends of pairs, to the owned ends of those with ghosts."""
    for a in range(len(start) - 1):
        for k in range(start[a], start[a + 1]):
            b, square = neighbour[k], 0.0
            for i in range(place.shape[1]):
                square += (place[a, i] - place[b, i]) ** 2
            w = shape(np.sqrt(square) * per_reach)
            total[a] += volume[b] * w
            if b < owned:
                total[b] += volume[a] * w


@kernel
def add_images(row, place, image, other, weight, per_reach, total):
    """Add what particles see of images."""
    for k in range(len(row)):
        square = 0.0
        for i in range(place.shape[1]):
            square += (place[row[k], i] - image[other[k], i]) ** 2
        total[row[k]] += weight[other[k]] * shape(np.sqrt(square) * per_reach)


def fill_depths(comm: Any, pairs: BodyPairs, systems: list[ParticleSystem], names: list[str]) -> None:
    """Set "contact_depth" of every particle in contact, 0 at h/2 within the face of its body to 1 on it; collective.

    names: of the scene's bodies. Raises SolverError, on all ranks, for bodies of one layer of particles.
    """
    fault = None
    for system in systems:
        for local, body in enumerate(system.bodies):
            # pairs of one reach and the same planes see the same
            seen: dict[Any, tuple[np.ndarray, np.ndarray, float, float]] = {}
            for pair in pairs.of_body(body):
                key = pair.law.reach, pair.planes
                if key not in seen:
                    colour, rows = own_colours(comm, system, local, pair)
                    fullest = maximum(comm, float(colour.max(initial=0.0)))
                    seen[key] = colour, rows, fullest, least_colour(pair, pairs, system.dimension)
                colour, rows, fullest, least = seen[key]
                inside = np.clip((1.0 - colour - pair.law.own_colour) / (0.5 - pair.law.own_colour), 0.0, 1.0)
                system.particles["contact_depth"].reshape(-1, pairs.slots)[rows, pair.slot] = inside
                if fullest < least:
                    fault = (
                        f"contact: expected bodies of at least two layers of particles, found one in {names[body]} "
                        f"(with contact.radius it fills {fullest:.2g} of its own kernel)"
                    )
    raise_together(comm, fault)


def overlap(depth: float, pair: BodyPair, pairs: BodyPairs, names: list[str]) -> str | None:
    """What is wrong with a body's particle so deep [m] in another at the start, or None."""
    least = min(pairs.kinds[body].spacing for body in (pair.own, pair.other))
    if depth <= _TOO_DEEP * least:
        return None
    return (
        f"contact: expected bodies that do not lie in one another at the start, found {names[pair.own]} "
        f"{depth / least:.2g} spacings deep in {names[pair.other]}"
    )


def least_colour(pair: BodyPair, pairs: BodyPairs, dimension: int) -> float:
    """What a body's particles in the middles of cells see of it at least, where it has two layers; nodes have them."""
    kind = pairs.kinds[pair.own]
    if kind.nodal:
        return 0.0
    first, second = (kind.spacing * over_planes(z, pair.law.reach, dimension)[0] for z in (0.0, kind.spacing))
    return first + 0.5 * second


def own_colours(comm: Any, system: ParticleSystem, local: int, pair: BodyPair) -> tuple[np.ndarray, np.ndarray]:
    """Colour (k,) of a body's particles in their own body in the reference, and their rows; collective."""
    read = system.particles.owned_rows
    rows = np.flatnonzero(read("body") == local)
    place = np.ascontiguousarray(read("reference_position")[rows])
    halo = Halo(comm, place, pair.law.reach * (1.0 + 1e-9))
    whole = halo.with_ghosts(place)
    volume = halo.with_ghosts(np.ascontiguousarray(read("volume")[rows] / shares_of(system, rows, pair)))
    d, inverse = place.shape[1], 1.0 / pair.law.reach
    total = volume * shape(0.0)
    search = ClosePairs()
    radius = np.full(len(whole), 0.5 * pair.law.reach)
    if len(rows):
        start, neighbour, outer, ghost = search.find(whole, radius, len(rows))
        add_colours(whole, volume, start, neighbour, len(rows), inverse, total)
        add_colours(whole, volume, outer, ghost, len(rows), inverse, total)
        for R, T in reflections(pair.planes, d):
            image = np.ascontiguousarray(whole * R + T)
            off = (np.abs(image - whole) > 1e-6 * pair.law.reach)[:, R < 0.0].all(axis=1)
            image, weight = image[off], volume[off]
            begin, other = search.across(place, radius[: len(rows)], image, radius[off])
            row = np.repeat(np.arange(len(rows)), np.diff(begin))
            add_images(row, place, image, other, weight, inverse, total)
    return norm(d, pair.law.reach) * total[: len(rows)], rows
