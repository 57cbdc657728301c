"""Which bodies are near each other, and how long that holds without a word between ranks.

Boxes of bodies and their mean velocities are agreed on at a build. Until the next one a body's particles stay in its
box, moved by its mean velocity and widened by a margin, or a rank asks for another build; so bodies that are apart cost
one look at each particle's place. Where two are near, no pair that was not listed may come within the kernel's reach:
particles within reach of the other's box move less than half a skin in the frame of the mean of both motions.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.collective import maximum
from parsolid.contact.body_pairs import BodyPairs
from parsolid.kernels import kernel
from parsolid.methods.protocol import ParticleSystem
from parsolid.pairs.displacement import body_bounds

# of the gap to the next body, what a body apart may outgrow its box by
_SHARE = 0.25
# of its speed of waves, by which a body's particles are taken to get faster until the next look
_FASTER = 0.01


class MovingBoxes(NamedTuple):
    """Of bodies: lower, upper corners now (bodies, d) [m], mean velocity [m/s]; margin (bodies,) [m], negative of
    bodies without contact; faster (bodies,) [m/s]: by how much particles may get faster."""

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    margin: np.ndarray
    faster: np.ndarray


class Partners(NamedTuple):
    """Near bodies of each body, start (bodies + 1,): lower and upper corners now (n, d) [m]; velocity [m/s] of the
    frame of both and how far it has moved [m] since the build, (n, d); allowed displacement in it, and the reach in
    which that counts (n,) [m]."""

    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    moved: np.ndarray
    allowed: np.ndarray
    reach: np.ndarray


@kernel
def time_left(place, velocity, listed, body, of_body, near, ahead):
    """How long [s] this rank's particles stay within what lists and boxes allow, at most `ahead`.

    place, velocity, listed (n, d); body (n,). of_body: `MovingBoxes` of the bodies now; near: `Partners` of each.
    """
    d, left = place.shape[1], ahead
    for a in range(len(place)):
        A = body[a]
        margin, more = of_body.margin[A], of_body.faster[A]
        if margin < 0.0:
            continue
        for i in range(d):
            room = min(place[a, i] - of_body.lower[A, i], of_body.upper[A, i] - place[a, i]) + margin
            speed = abs(velocity[a, i] - of_body.velocity[A, i]) + more
            if room < left * speed:
                left = room / speed
        for p in range(near.start[A], near.start[A + 1]):
            gap, square, faster = 0.0, 0.0, 0.0
            for i in range(d):
                v = velocity[a, i] - near.velocity[p, i]
                out = max(near.lower[p, i] - place[a, i], place[a, i] - near.upper[p, i], 0.0)
                gap += out * out
                u = place[a, i] - listed[a, i] - near.moved[p, i]
                square += u * u
                faster += v * v
            speed = math.sqrt(faster) + more
            if gap < (near.reach[p] + speed * left) ** 2:
                left = min(left, (near.allowed[p] - math.sqrt(square)) / speed)
    return left


class BroadPhase:
    """Boxes (bodies, d) [m] of the scene's bodies when they were agreed on, mean velocities [m/s], and margins [m].

    near: for each body pair, whether lists are needed, any_near: for one at least; beyond (pairs,) [m]: by what they
    reach farther than the kernel; expires: the time [s] at which bodies that are apart may meet; until (pairs,) [s]:
    how long after the agreement those of each may at first, 0 where near.
    """

    def __init__(self, comm: Any, bodies: int, pairs: BodyPairs, systems: list[ParticleSystem]) -> None:
        self.comm, self.systems, self.bodies = comm, systems, bodies
        self.numbers = [np.array(system.bodies) for system in systems]
        self.faster = np.zeros(bodies)
        for body, kind in pairs.kinds.items():
            self.faster[body] = _FASTER * kind.speed
        self.own, self.other, self.reach, self.skin = pairs.own, pairs.other, pairs.reach, pairs.skin

    def agree(self, time: float) -> None:
        """Boxes and motions at a time [s]; collective."""
        self.time, bodies = time, self.bodies
        self.lower, self.upper, self.velocity, _ = body_motions(self.comm, bodies, self.systems)
        own, other = self.own, self.other
        between = np.maximum(self.lower[own] - self.upper[other], self.lower[other] - self.upper[own])
        self.gap = gap = np.linalg.norm(np.maximum(between, 0.0), axis=1)
        gap[own == other] = 0.0
        apart = gap >= self.reach + self.skin
        self.margin = np.full(bodies, np.inf)
        np.minimum.at(self.margin, own, np.maximum(0.5 * self.skin, np.where(apart, _SHARE * gap, 0.0)))
        self.margin[np.isinf(self.margin)] = -1.0
        # until moving boxes with their margins are within reach of one another
        one, two = ((self.lower[i], self.upper[i], self.velocity[i]) for i in (own[apart], other[apart]))
        self.until = np.zeros(len(own))
        self.until[apart] = meetings(one, two, self.margin[own[apart]] + self.margin[other[apart]] + self.reach[apart])
        self.reach_beyond(0.0)

    def reach_beyond(self, distance: float) -> None:
        """Let lists reach farther than the kernel by a distance [m] where that is more than their skin: what comes so
        fast is seen before it presses."""
        self.beyond = np.maximum(self.skin, distance)
        self.near = self.gap < self.reach + self.beyond
        self.any_near = bool(self.near.any())
        near = np.flatnonzero(self.near)
        self._near_by_body = near[np.argsort(self.own[near], kind="stable")]
        self.until[self.near] = 0.0
        self.expires = self.time + float(self.until[~self.near].min(initial=np.inf))

    def time_left(self, time: float, ahead: float) -> float:
        """How long [s] after a time [s] this rank's lists hold, at most a time ahead [s]."""
        left = min(ahead, self.expires - time)
        elapsed = time - self.time
        moved = self.velocity * elapsed
        now = MovingBoxes(self.lower + moved, self.upper + moved, self.velocity, self.margin, self.faster)
        for system, number in zip(self.systems, self.numbers):
            if (self.margin[number] >= 0.0).any():
                rows = system.particles.owned_rows
                fields = rows("position"), rows("velocity"), rows("contact_listed"), rows("body")
                of_body = MovingBoxes(*(values[number] for values in now))
                left = time_left(*fields, of_body, self._partners(number, now, elapsed), left)
        return left

    def fastest(self, ahead: float) -> float:
        """The greatest speed [m/s] of this rank's particles of bodies that are near another one, or themselves, or may
        be in a time [s], against the mean of that, when boxes were agreed on."""
        most, coming = 0.0, self.until <= ahead
        for system, numbers in zip(self.systems, self.numbers):
            for local, number in enumerate(numbers):
                others = self.other[coming & (self.own == number)]
                rows = system.particles.owned_rows
                velocity = rows("velocity")[rows("body") == local] if len(others) else np.zeros((0, 0))
                for other in others if len(velocity) else ():
                    square = ((velocity - self.velocity[other]) ** 2).sum(axis=1)
                    most = max(most, float(square.max()) ** 0.5)
        return most

    def _partners(self, numbers: np.ndarray, now: MovingBoxes, elapsed: float) -> Partners:
        """Near bodies of each of some bodies."""
        near = self._near_by_body
        first, last = (np.searchsorted(self.own[near], numbers, side) for side in ("left", "right"))
        start = np.concatenate(([0], np.cumsum(last - first))).astype(np.int64)
        pairs = np.concatenate([near[:0], *(near[i:j] for i, j in zip(first, last))])
        other = self.other[pairs]
        frame, allowed = 0.5 * (self.velocity[self.own[pairs]] + self.velocity[other]), 0.5 * self.skin[pairs]
        reach = self.reach[pairs] + allowed
        return Partners(start, now.lower[other], now.upper[other], frame, elapsed * frame, allowed, reach)


def body_motions(comm: Any, bodies: int, systems: list[ParticleSystem]) -> tuple[np.ndarray, ...]:
    """Lower and upper corners (bodies, d) [m] of the present boxes, mean velocities (bodies, d) [m/s], coarsest
    spacing (bodies,) [m]; collective."""
    d = systems[0].dimension
    bounds, sums, spacing = np.full((bodies, 2, d), -np.inf), np.zeros((d + 1, bodies)), np.zeros(bodies)
    for system in systems:
        rows, body, number = system.particles.owned_rows, system.particles.owned_rows("body"), np.array(system.bodies)
        bounds[number] = body_bounds(np.ascontiguousarray(rows("position")), body, len(number))
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
