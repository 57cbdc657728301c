"""How far particles may move before pairs that are not listed come within the support.

A pair that is not listed was at least support (h_a + h_b)/2 (1 + skin) apart when the lists were made. It is beyond the
support as long as both have moved less than skin/2 support h, measured in any frame common to both. Within a body that
is the body's mean motion; for particles of two bodies it is the mean of the two motions, and it only counts where one
stands within reach of the box that the other body moves along with. An image behind a mirror plane is a body of its
own.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable


class BodyMotions(NamedTuple):
    """Mean velocities (bodies, d) [m/s], and the partners of body A, rows start[A] .. start[A + 1] - 1: boxes lower,
    upper (p, d) [m] when the lists were made, their velocities and those of the frames shared with A (p, d) [m/s].
    """

    velocity: np.ndarray
    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    partner: np.ndarray
    frame: np.ndarray


class Allowance(NamedTuple):
    """Displacement allowed a smoothing length, the widest reach of a pair [m], time since the build and time ahead that
    is asked about [s]."""

    share: float
    reach: float
    elapsed: float
    ahead: float


def body_motions(velocity: np.ndarray, lower: np.ndarray, upper: np.ndarray, codes: Any) -> BodyMotions:
    """velocity, lower, upper (bodies, d): mean velocity [m/s] and box [m] of each, an empty one upside down.

    codes: `MirrorCodes` or None.
    """
    d = velocity.shape[1]
    filled = (lower <= upper).all(axis=1)
    whole: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
    everywhere = np.ones(len(velocity), bool)
    for body in np.flatnonzero(filled):
        others = everywhere.copy()
        others[body] = False
        whole.append((others, lower[body], upper[body], velocity[body]))
    for code in range(0 if codes is None else len(codes.signs)):
        concerned = np.all([plane.concerns(np.arange(len(velocity))) for plane in codes.planes[code]], axis=0)
        R, T = codes.reflections[code, :d], codes.shifts[code, :d]
        for body in np.flatnonzero(filled & concerned):
            corners = np.stack((lower[body], upper[body])) * R + T
            whole.append((concerned, corners.min(axis=0), corners.max(axis=0), velocity[body] * R))
    rows = [[one for one in whole if one[0][body]] for body in range(len(velocity))]
    start = np.concatenate(([0], np.cumsum([len(row) for row in rows]))).astype(np.int64)
    listed = [(*one[1:], 0.5 * (velocity[body] + one[3])) for body, row in enumerate(rows) for one in row]
    columns = [np.array([one[k] for one in listed]).reshape(-1, d) for k in range(4)]
    return BodyMotions(velocity, start, *columns)


@compiled
def body_bounds(position: np.ndarray, body: np.ndarray, bodies: int) -> np.ndarray:
    """Negated lower and upper corner [m] of each body's particles, (bodies, 2, d), -inf without any."""
    d = position.shape[1]
    result = np.full((bodies, 2, d), -np.inf)
    for a in range(len(position)):
        for k in range(d):
            result[body[a], 0, k] = max(result[body[a], 0, k], -position[a, k])
            result[body[a], 1, k] = max(result[body[a], 1, k], position[a, k])
    return result


@register_jitable
def _use(moved: float, faster: float, allowed: float, ahead: float) -> int:
    """What `skin_use` says of one particle in one frame, by its squared displacement and relative speed."""
    # (p + q)^2 <= 2 p^2 + 2 q^2 spares most particles the roots
    if 2.0 * (moved + faster * ahead * ahead) <= allowed * allowed:
        return 0
    moved = np.sqrt(moved)
    if moved > allowed:
        return 2
    return 1 if moved + np.sqrt(faster) * ahead > allowed else 0


@compiled(error_model="numpy")
def skin_use(
    position: np.ndarray,
    velocity: np.ndarray,
    listed: np.ndarray,
    smoothing_length: np.ndarray,
    body: np.ndarray,
    motions: BodyMotions,
    allowance: Allowance,
) -> int:
    """0 where the lists are safe for the time ahead, 1 where they may not be, 2 where they are no longer.

    Of owned particles: position, velocity, listed (the position at the build) (n, d), smoothing_length, body (n,).
    In one function, because arrays handed to another cost more than the rest.
    """
    d, elapsed, ahead, result = position.shape[1], allowance.elapsed, allowance.ahead, 0
    for a in range(len(position)):
        A, allowed = body[a], allowance.share * smoothing_length[a]
        moved, faster = 0.0, 0.0
        for k in range(d):
            u = position[a, k] - listed[a, k] - motions.velocity[A, k] * elapsed
            w = velocity[a, k] - motions.velocity[A, k]
            moved, faster = moved + u * u, faster + w * w
        result = max(result, _use(moved, faster, allowed, ahead))
        for p in range(motions.start[A], motions.start[A + 1]):
            gap, faster = 0.0, 0.0
            for k in range(d):
                at = position[a, k] - motions.partner[p, k] * elapsed
                outside = max(motions.lower[p, k] - at, at - motions.upper[p, k], 0.0)
                w = velocity[a, k] - motions.partner[p, k]
                gap, faster = gap + outside * outside, faster + w * w
            # within reach of the partner's box in the time ahead? (p + q)^2 <= 1.1 p^2 + 11 q^2
            if gap < 1.1 * allowance.reach**2 + 11.0 * faster * ahead**2:
                moved, faster = 0.0, 0.0
                for k in range(d):
                    u = position[a, k] - listed[a, k] - motions.frame[p, k] * elapsed
                    w = velocity[a, k] - motions.frame[p, k]
                    moved, faster = moved + u * u, faster + w * w
                result = max(result, _use(moved, faster, allowed, ahead))
    return result
