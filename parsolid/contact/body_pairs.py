"""What is constant of a contact: the spacing and stiffness of its bodies, the kernel, the threshold and its slope."""

from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import maximum
from parsolid.contact.kernel import lattice_colour, norm
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.container import Particles
from parsolid.scene import Scene
from parsolid.scene.contact import contact_pairs, of_model

# skin of the lists, in spacings
SKIN = 0.5
# step over the limit of a contact's frequency: what is exchanged in a step grows with its square; the power of a
# stiffness above 1 by which it is less, for then particles of a face meet and part many times; by how much it is less
# where one body does not damp that, and where neither does
_SAFETY, _STIFF, _LESS, _LEAST = 0.5, -0.125, 2.0 / 3.0, 0.36
# entries of the tables of colour against depth
_TABLE = 65


class BodyKind(NamedTuple):
    """Spacing [m], modulus lambda + 2 mu [Pa] and wave speed [m/s] of a body; nodal: particles on its faces; undamped:
    its method, see `ParticleSystem`."""

    spacing: float
    modulus: float
    speed: float
    nodal: bool
    undamped: bool


class ContactLaw(NamedTuple):
    """What a body of one kind feels of a body of another.

    reach: R [m]; skin [m]; stiffness: kappa [Pa/m]; norm: N R^-d [1/m^d]; own_colour: c_AA, of the own lattice seen
    from h_own/2 outside; colour, slope: tables of the other lattice's colour and its slope [1/m] at depths from
    h_own/2 outside to the face; longest: step [s] that the contact alone allows.
    """

    reach: float
    skin: float
    stiffness: float
    friction: float
    norm: float
    own_colour: float
    colour: np.ndarray
    slope: np.ndarray
    longest: float

    def threshold(self, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """c0 and slope s [1/m] (n,) of particles by how far from h/2 within their face (0) to on it (1) they are."""
        colour = self.colour[0] + inside * (self.colour[-1] - self.colour[0])
        return colour, np.interp(colour, self.colour, self.slope)


class BodyPair(NamedTuple):
    """A body `own` that may touch a body `other` or itself, numbers of the scene; reverse: number of the pair the
    other way round; slot: number among the pairs of its own body; planes: axis and coordinate of symmetry planes of
    both."""

    own: int
    other: int
    reverse: int
    slot: int
    law: ContactLaw
    planes: tuple[tuple[int, float], ...]


class BodyPairs:
    """All pairs of bodies that may touch, each both ways round, and the kinds of these bodies; slots: the most pairs of
    one body, for each particle. Arrays over pairs: own, other, reverse; reach, skin [m]."""

    def __init__(self, pairs: list[BodyPair], kinds: dict[int, BodyKind]) -> None:
        self.pairs, self.kinds = pairs, kinds
        self.slots = max((pair.slot + 1 for pair in pairs), default=0)
        self.own, self.other, self.reverse = (np.array([pair[k] for pair in pairs], np.int64) for k in range(3))
        self.reach, self.skin = np.array([pair.law[:2] for pair in pairs]).reshape(-1, 2).T.copy()
        self._of_body: dict[int, list[BodyPair]] = {}
        for pair in pairs:
            self._of_body.setdefault(pair.own, []).append(pair)

    def of_body(self, body: int) -> list[BodyPair]:
        """Pairs of a body of the scene."""
        return self._of_body.get(body, [])


def slots_of(scene: Scene) -> int:
    """The most pairs that one body has."""
    count = np.zeros(len(scene.bodies), int)
    for pair in contact_pairs(of_model(scene.contact, "kernel"), [body.name for body in scene.bodies]):
        count[list({pair.first, pair.second})] += 1
    return int(count.max(initial=0))


def body_pairs(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> BodyPairs:
    """Every pair of bodies in contact, both ways round, once for a body with itself; collective."""
    stated = contact_pairs(of_model(scene.contact, "kernel"), [body.name for body in scene.bodies])
    used = sorted({body for pair in stated for body in pair[:2]})
    kinds, planes = _kinds(comm, scene, systems, used), _planes(systems)
    pairs: list[BodyPair] = []
    slots = dict.fromkeys(used, 0)
    for first, second, contact in stated:
        both = [(first, second)] if first == second else [(first, second), (second, first)]
        last = 2 * len(pairs) + len(both) - 1
        shared = tuple(plane for plane in planes.get(first, ()) if plane in planes.get(second, ()))
        numbers = contact.radius, contact.stiffness, contact.friction
        for own, other in both:
            law = contact_law(kinds[own], kinds[other], *numbers, scene.dimension)
            pairs.append(BodyPair(own, other, last - len(pairs), slots[own], law, shared))
            slots[own] += 1
    return BodyPairs(pairs, kinds)


# bodies of one kind have the same, whatever their number
@lru_cache(maxsize=4096)
def contact_law(
    own: BodyKind, other: BodyKind, radius: float, stiffness: float, friction: float, dimension: int
) -> ContactLaw:
    """The law between two kinds; radius, stiffness, friction: as the scene states them."""
    coarse = max(own.spacing, other.spacing)
    reach = radius * coarse
    softer = min((own, other), key=lambda kind: kind.modulus / kind.spacing)
    depth = np.linspace(0.5 * own.spacing, 0.0, _TABLE)
    table = [lattice_colour(float(z), other.spacing, other.nodal, reach, dimension) for z in depth]
    own_colour, _ = lattice_colour(0.5 * own.spacing, own.spacing, own.nodal, reach, dimension)
    shaken = (1.0, _LESS, _LEAST)[own.undamped + other.undamped]
    frequency = np.sqrt(2.0 * stiffness) * softer.speed / softer.spacing
    safety = _SAFETY * max(stiffness, 1.0) ** _STIFF * shaken
    return ContactLaw(
        reach,
        SKIN * coarse,
        stiffness * softer.modulus / softer.spacing,
        friction,
        norm(dimension, reach),
        own_colour,
        np.array([one[0] for one in table]),
        np.array([one[1] for one in table]),
        float(safety * 2.0 / frequency),
    )


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


def _kinds(comm: Any, scene: Scene, systems: list[ParticleSystem], used: list[int]) -> dict[int, BodyKind]:
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
            result[body] = BodyKind(coarsest, modulus, speed, nodal, system.undamped)
    return result


def _planes(systems: list[ParticleSystem]) -> dict[int, tuple[tuple[int, float], ...]]:
    """Axis and coordinate of the symmetry planes of each body of the scene."""
    result: dict[int, tuple[tuple[int, float], ...]] = {}
    for system in systems:
        for local, body in enumerate(system.bodies):
            here = [plane for plane in system.symmetry_planes if plane.body in (None, local)]
            result[body] = tuple((plane.axis, plane.coordinate) for plane in here)
    return result


def share_of(particles: Particles, rows: np.ndarray) -> np.ndarray:
    """The parts (k,) of particles on this side of symmetry planes."""
    return particles.owned_rows("share")[rows] if "share" in particles else np.ones(len(rows))


def shares_of(system: ParticleSystem, rows: np.ndarray, pair: BodyPair) -> np.ndarray:
    """The parts (k,) of a system's particles on this side of symmetry planes that both bodies have.

    Behind a plane that the other body does not have there is nothing for it to feel: no image, and no second half of
    what lies on it.
    """
    share = share_of(system.particles, rows)
    if not (share < 1.0).any():
        return share
    place, result = system.particles.owned_rows("reference_position")[rows], np.ones(len(rows))
    for axis, coordinate in pair.planes:
        result[np.abs(place[:, axis] - coordinate) < 1e-6 * pair.law.reach] *= 0.5
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
