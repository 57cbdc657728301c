"""Which bodies are near each other, and how long that holds without a word between ranks.

Boxes of bodies and their mean velocities are agreed on at a build. Until the next one a body's particles stay in its
box, moved by its mean velocity and widened by a margin, or a rank asks for another build; so bodies that are apart cost
one look at each particle's place. Where two are near, no pair that was not listed may come within the kernel's reach:
particles within reach of the other's box move less than half a skin in the frame of the mean of both motions.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.collective import maximum
from parsolid.contact.list_kernels import time_left
from parsolid.contact.sides import Side, Sides
from parsolid.methods.protocol import ParticleSystem
from parsolid.pairs.displacement import body_bounds

# of the gap to the next body, what a body apart may outgrow its box by
_SHARE = 0.25
# of its speed of waves, by which a body's particles are taken to get faster until the next look
_FASTER = 0.01


class Boxes:
    """Boxes (bodies, d) [m] of the scene's bodies when they were agreed on, mean velocities [m/s], and margins [m].

    near: whether lists are needed for each side; expires: the time [s] at which bodies that are apart may meet.
    """

    def __init__(self, comm: Any, bodies: int, sides: Sides, systems: list[ParticleSystem]) -> None:
        self.comm, self.sides, self.systems, self.bodies = comm, sides, systems, bodies
        self.numbers = [np.array(system.bodies) for system in systems]
        self.faster = np.zeros(bodies)
        for body, facts in sides.facts.items():
            self.faster[body] = _FASTER * facts.speed

    def agree(self, time: float) -> None:
        """Boxes and motions at a time [s]; collective."""
        self.time, bodies = time, self.bodies
        self.lower, self.upper, self.velocity, _ = body_motions(self.comm, bodies, self.systems)
        self.near = np.array([self._gap(side) < side.reach + side.skin for side in self.sides.sides])
        self.margin = np.full(bodies, -1.0)
        for side, near in zip(self.sides.sides, self.near):
            wanted = 0.5 * side.skin if near else max(0.5 * side.skin, _SHARE * self._gap(side))
            known = self.margin[side.own]
            self.margin[side.own] = wanted if known < 0.0 else min(known, wanted)
        apart = [side for side, near in zip(self.sides.sides, self.near) if not near]
        self.expires = min((time + self._meeting(side) for side in apart), default=np.inf)

    def _gap(self, side: Side) -> float:
        if side.own == side.other:
            return 0.0
        between = np.maximum(
            self.lower[side.own] - self.upper[side.other], self.lower[side.other] - self.upper[side.own]
        )
        return float(np.linalg.norm(np.maximum(between, 0.0)))

    def _meeting(self, side: Side) -> float:
        """Time [s] until the moving boxes with their margins are within reach of one another."""
        one, other = ((self.lower[i], self.upper[i], self.velocity[i]) for i in (side.own, side.other))
        return meeting(one, other, self.margin[side.own] + self.margin[side.other] + side.reach)

    def time_left(self, time: float, ahead: float) -> float:
        """How long [s] after a time [s] this rank's lists hold, at most a time ahead [s]."""
        left = min(ahead, self.expires - time)
        elapsed = time - self.time
        moved = self.velocity * elapsed
        margins, faster = np.zeros_like(moved), np.zeros_like(moved)
        margins[:, 0], faster[:, 0] = self.margin, self.faster
        now = np.stack((self.lower + moved, self.upper + moved, self.velocity, margins, faster), axis=1)
        for system, number in zip(self.systems, self.numbers):
            if (self.margin[number] >= 0.0).any():
                rows = system.particles.owned_rows
                fields = rows("position"), rows("velocity"), rows("contact_listed"), rows("body")
                left = time_left(*fields, now[number], self._partners(number, elapsed), left)
        return left

    def _partners(self, numbers: np.ndarray, elapsed: float) -> tuple[np.ndarray, np.ndarray]:
        """Near bodies of each of some bodies, as `list_kernels.time_left` takes them."""
        d, start, rows = self.velocity.shape[1], [0], []
        for body in numbers:
            for number, side in self.sides.of_body(int(body)):
                if not self.near[number]:
                    continue
                other, frame = side.other, 0.5 * (self.velocity[side.own] + self.velocity[side.other])
                row = np.zeros((5, d))
                row[0], row[1] = (bound[other] + self.velocity[other] * elapsed for bound in (self.lower, self.upper))
                row[2], row[3] = frame, frame * elapsed
                row[4, 0], row[4, 1] = 0.5 * side.skin, side.reach + 0.5 * side.skin
                rows.append(row)
            start.append(len(rows))
        return np.array(start, np.int64), np.array(rows).reshape(-1, 5, d)


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


def meeting(one: tuple[np.ndarray, ...], other: tuple[np.ndarray, ...], reach: float) -> float:
    """Time [s] until two boxes (lower, upper, velocity) overlap, one of them widened by a reach [m]; inf if never."""
    first, last = 0.0, np.inf
    speed = one[2] - other[2]
    for k in range(len(speed)):
        low, high = other[0][k] - one[1][k] - reach, other[1][k] - one[0][k] + reach
        if speed[k] == 0.0:
            if low > 0.0 or high < 0.0:
                return np.inf
            continue
        times = sorted((low / speed[k], high / speed[k]))
        first, last = max(first, times[0]), min(last, times[1])
    return float(first) if first <= last else np.inf
