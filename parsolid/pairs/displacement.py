"""Use of a Verlet list: how far particles may move before a pair that is not listed comes within the support.

A pair that is not listed was at least support (h_a + h_b)/2 (1 + skin) apart when the list was made. It is beyond the
support as long as both particles have moved less than skin/2 support h, measured in any frame common to both. Within a
body that frame moves with the body's mean velocity. For particles of two bodies it moves with the mean of the two, and
it only counts where one of them stands within reach of the box that moves along with the other body. An image behind a
mirror plane counts as a body of its own.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.pair_search import close_boxes
from parsolid.kernels import inlined, kernel

# results of `skin_use`
SAFE, EXPIRES, LATE = 0, 1, 2


class BodyMotions(NamedTuple):
    """Mean velocities (bodies, d) [m/s] of bodies, and the bodies and images that body A may meet, in rows start[A] ..
    start[A + 1] - 1: their boxes lower, upper (p, d) [m] when the list was made, their velocities `partner`, and the
    velocities `frame` of the frames shared with A (p, d) [m/s].
    """

    velocity: np.ndarray
    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    partner: np.ndarray
    frame: np.ndarray


class Allowance(NamedTuple):
    """Displacement allowed over smoothing length, the widest reach of a pair [m], the time since the list was made and
    the time to come that is asked about [s]."""

    share: float
    reach: float
    elapsed: float
    ahead: float


def body_motions(velocity: np.ndarray, lower: np.ndarray, upper: np.ndarray, codes: Any, far: float) -> BodyMotions:
    """The motions of bodies with mean velocities (bodies, d) [m/s] in boxes lower, upper (bodies, d) [m], an empty
    one with lower > upper, and the partners less than `far` [m] away. codes: `MirrorCodes` or None."""
    bodies, d = velocity.shape
    filled = np.flatnonzero((lower <= upper).all(axis=1))
    # boxes of bodies, then those of their images by each code: source, code + 1, corners and velocity
    pieces = [(filled, np.zeros(len(filled), np.int64), lower[filled], upper[filled], velocity[filled])]
    concerned = [np.ones(bodies, bool)]
    for code in range(0 if codes is None else len(codes.signs)):
        concerned.append(np.all([plane.concerns(np.arange(bodies)) for plane in codes.planes[code]], axis=0))
        R, T, own = codes.reflections[code, :d], codes.shifts[code, :d], filled[concerned[-1][filled]]
        D = codes.drifts[code, :d]
        corners = np.stack((lower[own], upper[own])) * R + T
        # images that go along with matter are as far from it as that is thick, at most
        aside = np.where(D != R, 2.0 * (upper[own] - lower[own]), 0.0)
        corners = np.sort(np.where(D != R, np.stack((lower[own], upper[own])), corners), axis=0)
        corners += np.stack((-aside, aside))
        number = np.full(len(own), code + 1)
        pieces.append((own, number, corners.min(axis=0), corners.max(axis=0), velocity[own] * D))
    source, code_of, low, high, speed = (np.concatenate(each) for each in zip(*pieces))
    first, second = close_boxes(low, high, far)
    owner, box = np.concatenate((first, second)), np.concatenate((second, first))
    kept = (owner < len(filled)) & np.array(concerned)[code_of[box], source[owner]]
    body, box = source[owner[kept]], box[kept]
    order = np.lexsort((box, body))
    body, box = body[order], box[order]
    start = np.concatenate(([0], np.cumsum(np.bincount(body, minlength=bodies)))).astype(np.int64)
    return BodyMotions(velocity, start, low[box], high[box], speed[box], 0.5 * (velocity[body] + speed[box]))


@kernel
def body_bounds(position: np.ndarray, body: np.ndarray, bodies: int) -> np.ndarray:
    """Negated lower corner and upper corner [m] of each body's particles at position (n, d), as (bodies, 2, d); -inf
    without any."""
    d = position.shape[1]
    result = np.full((bodies, 2, d), -np.inf)
    for a in range(len(position)):
        for k in range(d):
            result[body[a], 0, k] = max(result[body[a], 0, k], -position[a, k])
            result[body[a], 1, k] = max(result[body[a], 1, k], position[a, k])
    return result


@inlined
def _use(moved, faster, allowed, ahead):
    """The result of `skin_use` for one particle in one frame, from its squared displacement and relative speed."""
    # (p + q)^2 <= 2 p^2 + 2 q^2 spares most particles the roots
    if 2.0 * (moved + faster * ahead * ahead) <= allowed * allowed:
        return 0
    if moved**0.5 > allowed:
        return 2
    return 1 if moved**0.5 + faster**0.5 * ahead > allowed else 0


@kernel
def skin_use(owned, position, velocity, listed, smoothing_length, body, motions, allowance):
    """SAFE where the list is safe for the time ahead, EXPIRES where it may not be, LATE where it is used already.

    Of the owned particles: position, velocity and listed, the position when the list was made (d, rows);
    smoothing_length (1, rows); body (rows,).
    """
    d, elapsed, ahead, result = len(position), allowance.elapsed, allowance.ahead, 0
    for a in range(owned):
        A, allowed = body[a], allowance.share * smoothing_length[0, a]
        moved, faster = 0.0, 0.0
        for k in range(d):
            u = position[k, a] - listed[k, a] - motions.velocity[A, k] * elapsed
            w = velocity[k, a] - motions.velocity[A, k]
            moved, faster = moved + u * u, faster + w * w
        result = max(result, _use(moved, faster, allowed, ahead))
        for p in range(motions.start[A], motions.start[A + 1]):
            gap, faster = 0.0, 0.0
            for k in range(d):
                at = position[k, a] - motions.partner[p, k] * elapsed
                outside = max(motions.lower[p, k] - at, at - motions.upper[p, k], 0.0)
                w = velocity[k, a] - motions.partner[p, k]
                gap, faster = gap + outside * outside, faster + w * w
            # within reach of the partner's box in the time ahead? (p + q)^2 <= 1.1 p^2 + 11 q^2
            if gap < 1.1 * allowance.reach**2 + 11.0 * faster * ahead**2:
                moved, faster = 0.0, 0.0
                for k in range(d):
                    u = position[k, a] - listed[k, a] - motions.frame[p, k] * elapsed
                    w = velocity[k, a] - motions.frame[p, k]
                    moved, faster = moved + u * u, faster + w * w
                result = max(result, _use(moved, faster, allowed, ahead))
    return result
