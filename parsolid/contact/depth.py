"""Depth of each particle below the surface of its own body in the reference, from which its threshold follows."""

from typing import Any

import numpy as np

from decomposition.halo import Halo
from decomposition.pair_search import ClosePairs
from parsolid.collective import maximum, raise_together
from parsolid.contact.bodies import ContactBodies, ContactLaw, images_behind, shares_of
from parsolid.contact.kernel import norm, over_planes, shape
from parsolid.kernels import kernel
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.generated import cell_volumes

# particles whose neighbours are listed at once
_AT_ONCE = 100_000


@kernel
def colours(start, neighbour, place, own_body, points, source, volume, body, per_reach):
    """Sums (n,) of V_b shape(|X_a - x|/R) over the points x in compressed rows that are particles b of the own body, or
    their images. place (n, d) [m], own_body (n,); points (m, d) [m]; source (m,): rows in volume [m^3] and body."""
    total = np.zeros(len(place))
    for a in range(len(place)):
        for k in range(start[a], start[a + 1]):
            b, square = source[neighbour[k]], 0.0
            if own_body[a] == body[b]:
                for i in range(place.shape[1]):
                    square += (place[a, i] - points[neighbour[k], i]) ** 2
                total[a] += volume[b] * shape(np.sqrt(square) * per_reach)
    return total


def fill_depths(comm: Any, contact: ContactBodies, systems: list[ParticleSystem], names: list[str]) -> None:
    """Set "contact_depth" of every particle in contact: 0 at h/2 below the face of its body, 1 on it; collective.

    names: of the scene's bodies. Raises SolverError, on all ranks, for bodies of one layer of particles.
    """
    # laws of one reach and the same planes have the same colours
    laws = {(own, law.reach, law.planes): (own, law) for own, law in contact.laws}
    fault = None
    for system in systems:
        of, fullest = system.particles.owned_rows, np.zeros(len(system.bodies))
        for own, law in laws.values():
            bodies = [k for k, body in enumerate(system.bodies) if contact.kinds.get(body) == own]
            if not bodies:
                continue
            rows = np.flatnonzero(np.isin(of("body"), bodies))
            colour = own_colours(comm, system, rows, law)
            inside = np.clip((1.0 - colour - law.own_colour) / (0.5 - law.own_colour), 0.0, 1.0)
            depth = of("contact_depth").reshape(-1, system.particles.fields["contact_depth"].components)
            depth[rows, contact.columns[own][law.reach, law.planes]] = inside
            fullest[:] = 0.0
            np.maximum.at(fullest, of("body")[rows], colour)
            fullest = maximum(comm, fullest)
            # of bodies of two layers; nodes always have two
            layers = [own.spacing * over_planes(z, law.reach, system.dimension)[0] for z in (0.0, own.spacing)]
            least = 0.0 if own.nodal else layers[0] + 0.5 * layers[1]
            thin = np.flatnonzero(fullest[bodies] < least)
            if len(thin):
                body = bodies[thin[0]]
                fault = (
                    f"contact: expected bodies of at least two layers of particles, found one in "
                    f"{names[system.bodies[body]]} (with contact.radius it fills {fullest[body]:.2g} of "
                    "its own kernel)"
                )
    raise_together(comm, fault)


def own_colours(comm: Any, system: ParticleSystem, rows: np.ndarray, law: ContactLaw) -> np.ndarray:
    """Colours (k,) in the reference of rows, all particles of some bodies, by their own bodies; collective."""
    read = system.particles.owned_rows
    place, body = np.ascontiguousarray(read("reference_position")[rows]), read("body")[rows].astype(np.int64)
    halo = Halo(comm, place, law.reach * (1.0 + 1e-9))
    whole, body = halo.with_ghosts(place), halo.with_ghosts(body)
    volume = halo.with_ghosts(np.ascontiguousarray(cell_volumes(system.particles)[rows] / shares_of(system, rows, law)))
    images = list(images_behind(law.planes, whole, 1e-6 * law.reach))
    every = np.concatenate([whole, *(image for *_, image in images)])
    source, half = np.concatenate([np.arange(len(whole)), *(off for *_, off, _ in images)]), 0.5 * law.reach
    total = np.zeros(len(place))
    # a part at a time, as lists of all neighbours are long
    for here in np.array_split(np.arange(len(place)), len(place) // _AT_ONCE + 1):
        part = np.ascontiguousarray(place[here])
        start, neighbour = ClosePairs().across(part, np.full(len(part), half), every, np.full(len(every), half))
        total[here] = colours(start, neighbour, part, body[here], every, source, volume, body, 1.0 / law.reach)
    return norm(place.shape[1], law.reach) * total
