"""How deep each particle lies in its own body in the reference: the threshold of the other body's colour follows."""

from typing import Any

import numpy as np

from decomposition.halo import Halo
from decomposition.pair_search import ClosePairs
from parsolid.collective import maximum, raise_together
from parsolid.contact.kernel import norm, over_planes, shape
from parsolid.contact.list_kernels import add_colours, add_images
from parsolid.contact.sides import Side, Sides, reflections, shares_of
from parsolid.methods.protocol import ParticleSystem

# penetration at the start that is refused, in the smaller spacing
_TOO_DEEP = 1.0


def fill_depths(comm: Any, sides: Sides, systems: list[ParticleSystem], names: list[str]) -> None:
    """Set "contact_depth" of every particle in contact, 0 at h/2 within the face of its body to 1 on it; collective.

    names: of the scene's bodies. Raises SolverError, on all ranks, for bodies of one layer of particles.
    """
    fault = None
    for system in systems:
        for local, body in enumerate(system.bodies):
            # sides of one reach and the same planes see the same
            seen: dict[Any, tuple[np.ndarray, np.ndarray, float, float]] = {}
            for _, side in sides.of_body(body):
                key = side.reach, side.planes
                if key not in seen:
                    colour, rows = own_colours(comm, system, local, side)
                    fullest = maximum(comm, float(colour.max(initial=0.0)))
                    seen[key] = colour, rows, fullest, least_colour(side, sides, system.dimension)
                colour, rows, fullest, least = seen[key]
                inside = np.clip((1.0 - colour - side.own_colour) / (0.5 - side.own_colour), 0.0, 1.0)
                system.particles["contact_depth"].reshape(-1, sides.slots)[rows, side.slot] = inside
                if fullest < least:
                    fault = (
                        f"contact: expected bodies of at least two layers of particles, found one in {names[body]} "
                        f"(with contact.radius it fills {fullest:.2g} of its own kernel)"
                    )
    raise_together(comm, fault)


def overlap(depth: float, side: Side, sides: Sides, names: list[str]) -> str | None:
    """What is wrong with a body's particle so deep [m] in another at the start, or None."""
    least = min(sides.facts[body].spacing for body in (side.own, side.other))
    if depth <= _TOO_DEEP * least:
        return None
    return (
        f"contact: expected bodies that do not lie in one another at the start, found {names[side.own]} "
        f"{depth / least:.2g} spacings deep in {names[side.other]}"
    )


def least_colour(side: Side, sides: Sides, dimension: int) -> float:
    """What a body's particles in the middles of cells see of it at least, where it has two layers; nodes have them."""
    facts = sides.facts[side.own]
    if facts.nodal:
        return 0.0
    first, second = (facts.spacing * over_planes(z, side.reach, dimension)[0] for z in (0.0, facts.spacing))
    return first + 0.5 * second


def own_colours(comm: Any, system: ParticleSystem, local: int, side: Side) -> tuple[np.ndarray, np.ndarray]:
    """Colour (k,) of a body's particles in their own body in the reference, and their rows; collective."""
    read = system.particles.owned_rows
    rows = np.flatnonzero(read("body") == local)
    place = np.ascontiguousarray(read("reference_position")[rows])
    halo = Halo(comm, place, side.reach * (1.0 + 1e-9))
    whole = halo.with_ghosts(place)
    volume = halo.with_ghosts(np.ascontiguousarray(read("volume")[rows] / shares_of(system, rows, side)))
    d, inverse = place.shape[1], 1.0 / side.reach
    total = volume * shape(0.0)
    search = ClosePairs()
    radius = np.full(len(whole), 0.5 * side.reach)
    if len(rows):
        start, neighbour, outer, ghost = search.find(whole, radius, len(rows))
        add_colours(whole, volume, start, neighbour, len(rows), inverse, total)
        add_colours(whole, volume, outer, ghost, len(rows), inverse, total)
        for R, T in reflections(side.planes, d):
            image = np.ascontiguousarray(whole * R + T)
            off = (np.abs(image - whole) > 1e-6 * side.reach)[:, R < 0.0].all(axis=1)
            image, weight = image[off], volume[off]
            begin, other = search.across(place, radius[: len(rows)], image, radius[off])
            row = np.repeat(np.arange(len(rows)), np.diff(begin))
            add_images(row, place, image, other, weight, inverse, total)
    return norm(d, side.reach) * total[: len(rows)], rows
