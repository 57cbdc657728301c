"""Constants of contacts: spacing and stiffness of bodies, kernel, threshold and its slope."""

from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

from parsolid.boundary.conditions import HALF
from parsolid.collective import maximum
from parsolid.contact.kernel import lattice_colour, norm
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.container import Particles
from parsolid.scene import Scene
from parsolid.scene.contact import Contact, of_model

# skin of the lists, in spacings
SKIN = 0.5
# step over its limit by the frequency of the contact: the energy error of a step grows with its square; the power of a
# stiffness above 1 that reduces it, as particles of a face then meet and part many times; factors where one body does
# not damp these oscillations, and where neither does
_SAFETY, _STIFF, _LESS, _LEAST = 0.5, -0.125, 2.0 / 3.0, 0.36
# entries of the tables of colour against depth
_TABLE = 65


class BodyKind(NamedTuple):
    """Bodies of one kind are equal to contact. spacing [m]; modulus lambda + 2 mu [Pa]; wave speed [m/s]; nodal:
    particles lie on the faces; undamped: see `ParticleSystem`; planes: axis and coordinate of symmetry planes."""

    spacing: float
    modulus: float
    speed: float
    nodal: bool
    undamped: bool
    planes: tuple[tuple[int, float], ...]


class ContactLaw(NamedTuple):
    """The contact of a body of one kind with a body of another.

    reach: R [m]; skin [m]; stiffness: kappa [Pa/m]; norm: N R^-d [1/m^d]; own_colour: c_AA, of the own lattice at
    h_own/2 outside; colour, slope: tables of the other lattice's colour and its slope [1/m], from h_own/2 outside to
    the face; longest: step [s] that the contact alone allows; planes: symmetry planes of both.
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
    planes: tuple[tuple[int, float], ...]

    def threshold(self, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """c0 and slope s [1/m] (n,) of particles at h/2 below their face (inside (n,) = 0) to on it (1)."""
        colour = self.colour[0] + inside * (self.colour[-1] - self.colour[0])
        return colour, np.interp(colour, self.colour, self.slope)


class ContactBodies:
    """The bodies of a scene in contact, their kinds, and the laws between kinds.

    members: bodies of each contact, rising; kinds: body -> its kind; laws: (own kind, law), for each contact and two
    kinds; columns: kind -> (reach, planes) -> column of "contact_depth"; alone (bodies,): whether a body may touch
    itself.
    """

    def __init__(self, comm: Any, scene: Scene, systems: list[ParticleSystem]) -> None:
        """Collective."""
        contacts, self.members = members_of(scene)
        self.kinds = _kinds(comm, scene, systems, set(np.concatenate(self.members).tolist()))
        number = {kind: k for k, kind in enumerate(dict.fromkeys(self.kinds.values()))}
        self._kind, self._count = np.zeros(len(scene.bodies), np.int64), len(number)
        self._kind[list(self.kinds)] = [number[kind] for kind in self.kinds.values()]
        self.alone = np.zeros(len(scene.bodies), bool)
        self.alone[[members[0] for members in self.members if len(members) == 1]] = True
        found: dict[int, tuple[BodyKind, ContactLaw]] = {}
        for k, (contact, members) in enumerate(zip(contacts, self.members)):
            count: Any = Counter(self.kinds[body] for body in members.tolist())
            for own, other in product(count, count):
                if own != other or count[own] > 1 or len(members) == 1:
                    stated: Any = (contact.radius, contact.stiffness, contact.friction, scene.dimension)
                    found[self._code(k, number[own], number[other])] = own, contact_law(own, other, *stated)
        self._codes, self.laws = np.array(sorted(found)), [found[code] for code in sorted(found)]
        self.columns: dict[BodyKind, dict[Any, int]] = {}
        for own, law in self.laws:
            of_kind = self.columns.setdefault(own, {})
            of_kind.setdefault((law.reach, law.planes), len(of_kind))

    def _code(self, contact: Any, own: Any, other: Any) -> Any:
        """A number for a contact and the kinds of two bodies."""
        return (contact * self._count + own) * self._count + other

    def laws_between(self, contact: np.ndarray, own: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Indices in `laws` (n,) of pairs of bodies own, other (n,) in contacts (n,)."""
        return np.searchsorted(self._codes, self._code(contact, self._kind[own], self._kind[other]))

    @property
    def reach(self) -> float:
        """The widest of any pair [m]."""
        return max(law.reach for _, law in self.laws)


def members_of(scene: Scene) -> tuple[list[Contact], list[np.ndarray]]:
    """The contacts of the model "kernel" of a scene, and the bodies of each, rising."""
    contacts, number = of_model(scene.contact, "kernel"), {body.name: i for i, body in enumerate(scene.bodies)}
    return contacts, [np.array(sorted(number[name] for name in one.bodies)) for one in contacts]


def most_partners(scene: Scene) -> int:
    """The most bodies that one may touch, itself included."""
    count = np.zeros(len(scene.bodies), int)
    for members in members_of(scene)[1]:
        count[members] += max(len(members) - 1, 1)
    return int(count.max(initial=0))


@lru_cache(maxsize=4096)
def contact_law(
    own: BodyKind, other: BodyKind, radius: float, stiffness: float, friction: float, dimension: int
) -> ContactLaw:
    """The law between two kinds; radius, stiffness, friction: see `scene.contact.Contact`."""
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
        tuple(plane for plane in own.planes if plane in other.planes),
    )


def areas_of(system: ParticleSystem, rows: np.ndarray, volume: np.ndarray, share: np.ndarray | None) -> np.ndarray:
    """Areas (k,) [m^2] of particles of volumes (k,) [m^3]: volume over spacing, or the part of the face of a node that
    lies on one; in axisymmetry per radian. share (k,): part of nodes on this side of symmetry planes; None for
    particles in cells."""
    values = system.particles.owned_rows
    spacing = np.prod(values("spacing")[rows], axis=1) ** (1.0 / system.dimension)
    result = volume / spacing
    if share is not None and "area" in system.particles:
        area = np.abs(values("area")[rows]) / share[:, None]
        result = np.maximum(result, area.max(axis=1))
    return np.asarray(result * thickness(system, values("reference_position")[rows]))


def thickness(system: ParticleSystem, places: np.ndarray) -> np.ndarray | float:
    """Thickness at reference places (k, d) [m]: 1, in axisymmetry the radius, as masses are per radian."""
    return places[:, 0] if getattr(system.settings, "geometry", None) == "axisymmetric" else 1.0


def _kinds(comm: Any, scene: Scene, systems: list[ParticleSystem], used: set[int]) -> dict[int, BodyKind]:
    """Kinds of the bodies in contact; collective. Spacings that differ by round-off count as one."""
    result, d = {}, scene.dimension
    for system in systems:
        widest = np.zeros(len(system.bodies))
        body_of = system.particles.owned_rows("body")
        np.maximum.at(widest, body_of, np.prod(system.particles.owned_rows("spacing"), axis=1) ** (1.0 / d))
        widest = maximum(comm, widest)
        for local, body in enumerate(system.bodies):
            if body not in used:
                continue
            modulus, density = system.wave_modulus(local)
            density *= system.least_mass(local)
            stated = scene.bodies[body]
            # one row of nodes lies in the middle of its layer
            nodal = stated.placed_on == "vertices" and 1 not in (stated.particles or ())
            spacing, speed = float(f"{widest[local]:.13g}"), float(np.sqrt(modulus / density))
            here = [plane for plane in system.symmetry_planes if plane.body in (None, local)]
            planes = tuple((plane.axis, plane.coordinate) for plane in here)
            result[body] = BodyKind(spacing, modulus, speed, nodal, system.undamped, planes)
    return result


def share_of(particles: Particles, rows: np.ndarray) -> np.ndarray:
    """The parts (k,) of particles on this side of symmetry planes."""
    result = particles.owned_rows("share")[rows] if "share" in particles else np.ones(len(rows))
    return result * particles.owned_rows(HALF)[rows] if HALF in particles else result


def shares_of(system: ParticleSystem, rows: np.ndarray, law: ContactLaw) -> np.ndarray:
    """The parts (k,) of a system's particles on this side of the symmetry planes of both bodies.

    Behind a plane of one body alone, the other body touches nothing: no image, and no second half of particles on it.
    """
    share = share_of(system.particles, rows)
    if not (share < 1.0).any():
        return share
    place, result = system.particles.owned_rows("reference_position")[rows], np.ones(len(rows))
    for axis, coordinate in law.planes:
        result[np.abs(place[:, axis] - coordinate) < 1e-6 * law.reach] *= 0.5
    return np.maximum(share, result)


def near_box(place: np.ndarray, lower: np.ndarray, upper: np.ndarray, reach: Any) -> np.ndarray:
    """Which places (n, d) [m] are within reach (n,) [m] of boxes with corners lower, upper (d,) or (n, d) [m]."""
    gap = np.maximum(np.maximum(lower - place, place - upper), 0.0)
    return np.asarray(np.einsum("ni,ni->n", gap, gap) < reach * reach)


def images_behind(
    planes: tuple[tuple[int, float], ...], place: np.ndarray, least: np.ndarray | float
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Images R x + T of places (n, d) [m] in each plane, and at the common edge or corner of several: R, T (d,), rows
    and images of the places farther than half of least (n,) [m] from the planes; on a plane, a particle is its own."""
    dimension = place.shape[1]
    for size in range(1, dimension + 1):
        for subset in combinations(planes, size):
            if len({axis for axis, _ in subset}) == size:
                R, T = np.ones(dimension), np.zeros(dimension)
                for axis, coordinate in subset:
                    R[axis], T[axis] = -1.0, 2.0 * coordinate
                image = place * R + T
                off = np.flatnonzero((np.abs(image - place) > np.reshape(least, (-1, 1)))[:, R < 0.0].all(axis=1))
                yield R, T, off, image[off]
