"""Which bodies are near each other, and how long that holds without communication.

At a build, ranks agree on boxes and mean velocities of bodies. Until the next build the particles of a body stay in its
box, moved by the mean velocity and widened by a margin; otherwise a rank requests a build. So bodies that are apart
cost one check of each particle's position. Pairs of bodies are found by a sweep. Where two bodies are near, no pair of
particles that is not listed may come within the kernel's reach: particles within reach of the other box move by less
than half a skin, in the frame of the mean of both velocities.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from decomposition.pair_search import close_boxes
from parsolid.collective import maximum
from parsolid.contact.bodies import ContactBodies
from parsolid.kernels import kernel
from parsolid.methods.protocol import ParticleSystem
from parsolid.pairs.displacement import body_bounds

# margin of the box of a body over the gap to the next body
_SHARE = 0.25
# contacts of at most so many bodies keep all pairs, others those nearer than so many reaches of the kernel
_FEW, _FAR = 64, 3.5
# share of the wave speed by which particles are taken to get faster until the next check
SPEED_GAIN = 0.01


class MovingBoxes(NamedTuple):
    """Boxes of all bodies: lower, upper (bodies, d) [m] at the build; mean velocity [m/s]; margin (bodies,) [m],
    negative for bodies without contact; faster (bodies,) [m/s]: by how much particles may get faster."""

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    margin: np.ndarray
    faster: np.ndarray


class NearPairs(NamedTuple):
    """Near bodies `other` (n,) of each body, rows start[body] .. start[body + 1] - 1.

    allowed (n,) [m]: displacement of particles against the mean velocity of both bodies; reach (n,) [m]: of the other
    body's box, within which particles are bound by `allowed`.
    """

    start: np.ndarray
    other: np.ndarray
    allowed: np.ndarray
    reach: np.ndarray


@kernel
def time_left(place, velocity, listed, body, number, boxes, near, elapsed, ahead):
    """How long [s] this rank's particles stay within the bounds of lists and boxes, at most `ahead`.

    place, velocity, and listed: place at the build (n, d); body (n,): index in number, the bodies of `MovingBoxes`;
    near: `NearPairs`; elapsed [s]: since the build.
    """
    d, left, mean = place.shape[1], ahead, boxes.velocity
    for a in range(len(place)):
        A = number[body[a]]
        margin, more = boxes.margin[A], boxes.faster[A]
        if margin < 0.0:
            continue
        for i in range(d):
            x = place[a, i] - elapsed * mean[A, i]
            room = min(x - boxes.lower[A, i], boxes.upper[A, i] - x) + margin
            speed = abs(velocity[a, i] - mean[A, i]) + more
            if room < left * speed:
                left = room / speed
        for p in range(near.start[A], near.start[A + 1]):
            B, gap, square, faster = near.other[p], 0.0, 0.0, 0.0
            for i in range(d):
                frame = 0.5 * (mean[A, i] + mean[B, i])
                x = place[a, i] - elapsed * mean[B, i]
                gap += max(boxes.lower[B, i] - x, x - boxes.upper[B, i], 0.0) ** 2
                square += (place[a, i] - listed[a, i] - elapsed * frame) ** 2
                faster += (velocity[a, i] - frame) ** 2
            speed = math.sqrt(faster) + more
            if gap < (near.reach[p] + speed * left) ** 2:
                left = min(left, (near.allowed[p] - math.sqrt(square)) / speed)
    return left


@kernel
def fastest_against(velocity, body, number, mean, start, other):
    """The greatest speed [m/s] of particles, of velocities (n, d), relative to the mean velocities (bodies, d) of the
    bodies `other` in rows start[A] .. start[A + 1] - 1 of their own body A = number[body]."""
    most = 0.0
    for a in range(len(velocity)):
        for p in range(start[number[body[a]]], start[number[body[a]] + 1]):
            square = 0.0
            for i in range(velocity.shape[1]):
                square += (velocity[a, i] - mean[other[p], i]) ** 2
            most = max(most, square)
    return math.sqrt(most)


class BroadPhase:
    """Boxes and pairs of bodies as of the last `agree`.

    Bodies: lower, upper (bodies, d) [m]; velocity [m/s]; margin (bodies,) [m]. Pairs of bodies in contact less than
    `far` [m] apart, both ways round, sorted by own body, contact and other body: own, other: numbers of the bodies;
    reverse: index of the pair the other way round; law: index in `ContactBodies.laws`; reach, skin [m]; near: whether
    lists are needed; beyond [m]: by which lists reach farther than the kernel; until [s]: time until they may meet, 0
    where near. any_near: whether any pair is near; expires [s]: the time at which the first bodies that are apart may
    meet.
    """

    def __init__(self, comm: Any, bodies: int, contact: ContactBodies, systems: list[ParticleSystem]) -> None:
        self.comm, self.systems, self.bodies, self.contact = comm, systems, bodies, contact
        self.faster = np.zeros(bodies)
        for body, kind in contact.kinds.items():
            self.faster[body] = SPEED_GAIN * kind.speed
        self.used = np.array(sorted(contact.kinds))

    def agree(self, time: float, far: float = 0.0) -> None:
        """Boxes and velocities at a time [s], and at least the pairs less than `far` [m] apart; collective."""
        self.time = time
        self.lower, self.upper, self.velocity, _ = body_motions(self.comm, self.bodies, self.systems)
        self.far = max(far, _FAR * self.contact.reach) if max(map(len, self.contact.members)) > _FEW else np.inf
        self._find_pairs()
        own, other = self.own, self.other
        between = np.maximum(self.lower[own] - self.upper[other], self.lower[other] - self.upper[own])
        self.gap = gap = np.linalg.norm(np.maximum(between, 0.0), axis=1)
        gap[own == other] = 0.0
        apart = gap >= self.reach + self.skin
        self.margin = np.full(self.bodies, -1.0)
        self.margin[self.used] = _SHARE * self.far
        np.minimum.at(self.margin, own, np.maximum(0.5 * self.skin, np.where(apart, _SHARE * gap, 0.0)))
        # until moving boxes with their margins are within reach of one another
        one, two = ((self.lower[i], self.upper[i], self.velocity[i]) for i in (own[apart], other[apart]))
        self.until = np.zeros(len(own))
        self.until[apart] = meetings(one, two, self.margin[own[apart]] + self.margin[other[apart]] + self.reach[apart])
        self.reach_beyond(0.0)

    def _find_pairs(self) -> None:
        """Pairs of bodies in contact whose boxes are less than `far` apart."""
        pieces = [np.zeros((3, 0), np.int64)]
        for number, members in enumerate(self.contact.members):
            if len(members) < 3:
                pair = members[:1], members[-1:]
            else:
                pair = tuple(members[one] for one in close_boxes(self.lower[members], self.upper[members], self.far))
            pieces.append(np.stack((np.full(len(pair[0]), number), *pair)))
        contact, first, second = np.concatenate(pieces, axis=1)
        # both ways round, but once of a body with itself
        two = np.flatnonzero(first != second)
        own, other = np.append(first, second[two]), np.append(second, first[two])
        contact, reverse = np.append(contact, contact[two]), np.append(np.arange(len(first)), two)
        reverse[two] = len(first) + np.arange(len(two))
        order = np.lexsort((other, contact, own))
        self.own, self.other = own[order], other[order]
        self.reverse = np.argsort(order)[reverse[order]]
        self.law = self.contact.laws_between(contact[order], self.own, self.other)
        laws = [law[:2] for _, law in self.contact.laws]
        self.reach, self.skin = np.ascontiguousarray(np.array(laws)[self.law].T)

    def reach_beyond(self, distance: float) -> None:
        """Let lists reach farther than the kernel by a distance [m], at least their skin. Collective."""
        if self.contact.reach + distance > self.far:
            self.agree(self.time, 2.0 * (self.contact.reach + distance))
        self.beyond = np.maximum(self.skin, distance)
        self.near = self.gap < self.reach + self.beyond
        self.any_near = bool(self.near.any())
        self.until[self.near] = 0.0
        # pairs that were not kept are at least `far` apart
        velocity = self.velocity[self.used]
        fastest = 2.0 * float(np.linalg.norm(velocity - velocity.mean(axis=0), axis=1).max())
        room = (1.0 - 2.0 * _SHARE) * self.far - self.contact.reach
        unlisted = room / fastest if fastest > 0.0 else np.inf
        self.expires = self.time + min(float(self.until[~self.near].min(initial=np.inf)), unlisted)
        allowed = 0.5 * self.skin[self.near]
        start, other = self._by_body(self.near)
        self._bounds = (
            MovingBoxes(self.lower, self.upper, self.velocity, self.margin, self.faster),
            NearPairs(start, other, allowed, self.reach[self.near] + allowed),
        )

    def _by_body(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of chosen pairs: starts (bodies + 1,) of each own body, and the other bodies."""
        return np.searchsorted(self.own[chosen], np.arange(self.bodies + 1)), self.other[chosen]

    def time_left(self, time: float, ahead: float) -> float:
        """How long [s] after a time [s] this rank's lists are valid, at most `ahead` [s]."""
        left = min(ahead, self.expires - time)
        for system in self.systems:
            number = np.array(system.bodies)
            if (self.margin[number] >= 0.0).any():
                rows = system.particles.owned_rows
                fields = rows("position"), rows("velocity"), rows("contact_listed"), rows("body")
                left = time_left(*fields, number, *self._bounds, time - self.time, left)
        return left

    def fastest(self, ahead: float) -> float:
        """The greatest speed [m/s] of this rank's particles relative to bodies that are near, or may be within a time
        `ahead` [s] of the last `agree`."""
        coming, most = self._by_body(self.until <= ahead), 0.0
        for system in self.systems:
            velocity, body = map(system.particles.owned_rows, ("velocity", "body"))
            most = max(most, fastest_against(velocity, body, np.array(system.bodies), self.velocity, *coming))
        return most


def body_motions(
    comm: Any, bodies: int, systems: list[ParticleSystem], place: str = "position"
) -> tuple[np.ndarray, ...]:
    """Lower and upper corners (bodies, d) [m] of the boxes of a field of places, mean velocities (bodies, d) [m/s],
    coarsest spacing (bodies,) [m]; collective."""
    d = systems[0].dimension
    bounds, sums, spacing = np.full((bodies, 2, d), -np.inf), np.zeros((d + 1, bodies)), np.zeros(bodies)
    for system in systems:
        rows, body, number = system.particles.owned_rows, system.particles.owned_rows("body"), np.array(system.bodies)
        bounds[number] = body_bounds(np.ascontiguousarray(rows(place)[:, :d]), body, len(number))
        np.maximum.at(spacing, number[body], rows("spacing").max(axis=1))
        for k in range(d):
            sums[k, number] = np.bincount(body, rows("velocity")[:, k], minlength=len(number))
        sums[d, number] = np.bincount(body, minlength=len(number))
    bounds, spacing = maximum(comm, bounds), maximum(comm, spacing)
    comm.Allreduce(MPI.IN_PLACE, sums, MPI.SUM)
    return -bounds[:, 0], bounds[:, 1], np.ascontiguousarray((sums[:d] / np.maximum(sums[d], 1.0)).T), spacing


def meetings(one: tuple[np.ndarray, ...], other: tuple[np.ndarray, ...], reach: np.ndarray) -> np.ndarray:
    """Times (n,) [s] until n pairs of boxes overlap, one of them widened by a reach (n,) [m]; inf where never.

    one, other: lower, upper corners [m] and velocities [m/s], (n, d) each.
    """
    speed = one[2] - other[2]
    low, high = other[0] - one[1] - reach[:, None], other[1] - one[0] + reach[:, None]
    still = speed == 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.sort([low / speed, high / speed], axis=0)
    times[0][still], times[1][still] = -np.inf, np.inf
    never = (still & ((low > 0.0) | (high < 0.0))).any(axis=1)
    first, last = np.maximum(times[0].max(axis=1), 0.0), times[1].min(axis=1)
    return np.where(never | (first > last), np.inf, first)
