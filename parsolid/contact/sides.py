"""What is constant of a contact: the spacing and stiffness of its bodies, the kernel, the threshold and its slope."""

from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import maximum
from parsolid.contact.kernel import lattice_colour, norm
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.contact import contact_pairs, of_model

# skin of the lists, in spacings
SKIN = 0.5
# step over the limit of a contact's frequency: what is exchanged in a step grows with its square; the power of a
# stiffness above 1 by which it is less, for then particles of a face meet and part many times; by how much it is less
# where a body does not damp that, or moves in stages, which take from what a contact shakes, and where neither does
_SAFETY, _STIFF, _LESS, _LEAST = 0.5, -0.125, 2.0 / 3.0, 0.36
# entries of the tables of colour against depth
_TABLE = 65


class BodyFacts(NamedTuple):
    """Spacing [m], modulus lambda + 2 mu [Pa] and wave speed [m/s] of a body; nodal: particles on its faces; undamped,
    staged: its method, see `ParticleSystem`."""

    spacing: float
    modulus: float
    speed: float
    nodal: bool
    undamped: bool


class Side(NamedTuple):
    """What a body `own` feels of a body `other`, numbers of the scene; reverse: number of the other side.

    reach: R [m]; skin [m]; stiffness: kappa [Pa/m]; slot: number among the sides of its own body; depth, colour, slope:
    tables of the other lattice's colour and its slope [1/m] at depths from h_own/2 outside to the face [m];
    own_colour: c_AA, of the own lattice seen from h_own/2 outside; longest: step [s] that the contact alone allows.
    """

    own: int
    other: int
    reverse: int
    slot: int
    reach: float
    skin: float
    stiffness: float
    friction: float
    norm: float
    own_colour: float
    depth: np.ndarray
    colour: np.ndarray
    slope: np.ndarray
    longest: float
    planes: tuple[tuple[int, float], ...]

    def threshold(self, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """c0 and slope s [1/m] (n,) of particles by how far from h/2 within their face (0) to on it (1) they are."""
        colour = self.colour[0] + inside * (self.colour[-1] - self.colour[0])
        return colour, np.interp(colour, self.colour, self.slope)


class Sides:
    """All sides of a scene's contacts, and facts by body; slots: the most sides of one body, for each particle."""

    def __init__(self, sides: list[Side], facts: dict[int, BodyFacts]) -> None:
        self.sides, self.facts = sides, facts
        self.slots = max((side.slot + 1 for side in sides), default=0)
        self._of_body: dict[int, list[tuple[int, Side]]] = {}
        for number, side in enumerate(sides):
            self._of_body.setdefault(side.own, []).append((number, side))

    def of_body(self, body: int) -> list[tuple[int, Side]]:
        """Numbers and sides of a body of the scene."""
        return self._of_body.get(body, [])


def slots_of(scene: Scene) -> int:
    """The most sides that one body has."""
    count = np.zeros(len(scene.bodies), int)
    for pair in contact_pairs(of_model(scene.contact, "kernel"), [body.name for body in scene.bodies]):
        count[list({pair.first, pair.second})] += 1
    return int(count.max(initial=0))


def sides_of(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> Sides:
    """Every contact of a scene, from both sides, from one within a body; collective."""
    pairs = contact_pairs(of_model(scene.contact, "kernel"), [body.name for body in scene.bodies])
    used = sorted({body for pair in pairs for body in pair[:2]})
    facts = _facts(comm, scene, systems, used)
    planes = _planes(systems)
    sides: list[Side] = []
    slots = dict.fromkeys(used, 0)
    for pair in pairs:
        both = [(pair.first, pair.second)]
        if pair.first != pair.second:
            both.append((pair.second, pair.first))
        first = len(sides)
        for number, (own, other) in enumerate(both):
            reverse = first + (len(both) - 1 - number)
            shared = tuple(plane for plane in planes.get(own, ()) if plane in planes.get(other, ()))
            sides.append(_side(scene.dimension, facts, own, other, reverse, slots[own], pair.contact, shared))
            slots[own] += 1
    return Sides(sides, facts)


def areas_of(system: ParticleSystem, rows: np.ndarray, volume: np.ndarray, share: np.ndarray | None) -> np.ndarray:
    """Areas (k,) [m^2] of a face that particles (k,) of volumes (k,) [m^3] stand for: their own where they lie on one,
    volume over spacing; share (k,) of nodes, of which this is on this side of mirror planes, None for cells."""
    values = system.particles.owned_rows
    spacing = np.prod(values("spacing")[rows], axis=1) ** (1.0 / system.dimension)
    result = volume / spacing
    if share is not None and "area" in system.particles:
        area = np.abs(values("area")[rows]) / share[:, None]
        result = np.maximum(result, area.max(axis=1))
    return np.asarray(result)


def _side(
    dimension: int,
    facts: dict[int, BodyFacts],
    own: int,
    other: int,
    reverse: int,
    slot: int,
    contact: Any,
    planes: Any,
) -> Side:
    A, B = facts[own], facts[other]
    coarse = max(A.spacing, B.spacing)
    reach = contact.radius * coarse
    softer = min((A, B), key=lambda body: body.modulus / body.spacing)
    depth, colour, slope = _table(A.spacing, B.spacing, B.nodal, reach, dimension)
    own_colour, _ = lattice_colour(0.5 * A.spacing, A.spacing, A.nodal, reach, dimension)
    shaken = _LESS if A.undamped or B.undamped else 1.0
    shaken = _LEAST if A.undamped and B.undamped else shaken
    frequency = np.sqrt(2.0 * contact.stiffness) * softer.speed / softer.spacing
    safety = _SAFETY * max(contact.stiffness, 1.0) ** _STIFF * shaken
    return Side(
        own,
        other,
        reverse,
        slot,
        reach,
        SKIN * coarse,
        contact.stiffness * softer.modulus / softer.spacing,
        contact.friction,
        norm(dimension, reach),
        own_colour,
        depth,
        colour,
        slope,
        float(safety * 2.0 / frequency),
        planes,
    )


# bodies of one spacing have the same, whatever their number
@lru_cache(maxsize=4096)
def _table(own: float, spacing: float, nodal: bool, reach: float, dimension: int) -> tuple[np.ndarray, ...]:
    """Depths from half of an own spacing [m] outside to the face of another body, its colours and their slopes."""
    depth = np.linspace(0.5 * own, 0.0, _TABLE)
    table = [lattice_colour(float(z), spacing, nodal, reach, dimension) for z in depth]
    return depth, np.array([one[0] for one in table]), np.array([one[1] for one in table])


def _facts(comm: Any, scene: Scene, systems: list[ParticleSystem], used: list[int]) -> dict[int, BodyFacts]:
    """Of the bodies in contact; collective."""
    result, d = {}, scene.dimension
    for system in systems:
        for local, body in enumerate(system.bodies):
            if body not in used:
                continue
            rows = system.particles.owned_rows("body") == local
            spacing = np.prod(system.particles.owned_rows("spacing")[rows], axis=1) ** (1.0 / d)
            coarsest = maximum(comm, float(spacing.max(initial=0.0)))
            modulus, density = system.wave_modulus(local)
            stated = scene.bodies[body]
            # one row of nodes lies in the middle of its layer
            nodal = stated.placed_on == "nodes" and 1 not in (stated.particles or ())
            speed = float(np.sqrt(modulus / density))
            result[body] = BodyFacts(coarsest, modulus, speed, nodal, system.undamped)
    return result


def _planes(systems: list[ParticleSystem]) -> dict[int, tuple[tuple[int, float], ...]]:
    """Axis and coordinate of the symmetry planes of each body of the scene."""
    result: dict[int, tuple[tuple[int, float], ...]] = {}
    for system in systems:
        for local, body in enumerate(system.bodies):
            here = [plane for plane in system.symmetry_planes if plane.body in (None, local)]
            result[body] = tuple((plane.axis, plane.coordinate) for plane in here)
    return result


def shares_of(system: ParticleSystem, rows: np.ndarray, side: Side) -> np.ndarray:
    """The parts (k,) of a system's particles on this side of symmetry planes that both bodies have.

    Behind a plane that the other body does not have there is nothing for it to feel: no image, and no second half of
    what lies on it.
    """
    share = system.share[: system.owned][rows]
    if not (share < 1.0).any():
        return share
    place, result = system.particles.owned_rows("reference_position")[rows], np.ones(len(rows))
    for axis, coordinate in side.planes:
        result[np.abs(place[:, axis] - coordinate) < 1e-6 * side.reach] *= 0.5
    return np.maximum(share, result)


def reflections(planes: tuple[tuple[int, float], ...], dimension: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """R and T (d,) of every image: in one plane, or at the common edge or corner of several."""
    result = []
    for size in range(1, dimension + 1):
        for subset in combinations(planes, size):
            if len({axis for axis, _ in subset}) == size:
                R, T = np.ones(dimension), np.zeros(dimension)
                for axis, coordinate in subset:
                    R[axis], T[axis] = -1.0, 2.0 * coordinate
                result.append((R, T))
    return result
