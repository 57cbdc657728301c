"""Forces between particles and a rigid shape: a potential of the signed distance, and friction that sticks elastically.

    U = sum 1/2 k_i g_i^2,  g_i = max(0, r_i - d(x_i)),  k_i = alpha M V_i/h_i^2 (of a node on a face alpha M A_i/h_i)

so the force k_i g_i along the gradient of d is exact, and the tool takes its opposite at the place of the particle.
Friction records for each particle its point of adhesion on the tool and the stretch xi of a spring k_i/2 from there.
The point slips where the spring would pull by more than mu f_n (`contact.friction`).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.friction import combined, dot, gap_correction, return_mapping, tangential
from parsolid.contact.tools.shapes import distance
from parsolid.kernels import inlined, kernel


class Frame(NamedTuple):
    """Place (3,) [m] and rotation (3, 3) of a tool."""

    place: np.ndarray
    rotation: np.ndarray


class Friction(NamedTuple):
    """Coefficient; record (rows, 1 + 2 d): whether a particle adheres, its point [m] in the frame of the tool, xi [m];
    slipping: whether records follow the motion, or are kept."""

    coefficient: float
    record: np.ndarray
    slipping: bool


class Particles(NamedTuple):
    """Owned particles: position [m], velocity [m/s] (n, d); body (n,); touchable (bodies,): bodies that the tool may
    touch; radius (n,) [m]; stiffness (n,) [N/m] for alpha = 1; level (n,) [m]: depth in the tool in the last call,
    negative outside; square (n,) [1/s^2]: of the angular frequency on the spring of the contact.
    """

    owned: int
    position: np.ndarray
    velocity: np.ndarray
    body: np.ndarray
    touchable: np.ndarray
    radius: np.ndarray
    stiffness: np.ndarray
    level: np.ndarray
    square: np.ndarray


class Touched(NamedTuple):
    """The particles that a tool presses, or pressed before the step.

    row (n,); arm (n, 3) [m]: from the place of the tool; force (n, 3) [N]; correction (n, 3) [N]: of the impulse over
    half the step, see `friction.gap_correction`; pressed (n,): 1 where it is in the tool now; stored, stuck, lost (n,)
    [J]: energy of the penetration, of the spring of friction, and dissipation by friction.
    """

    row: np.ndarray
    arm: np.ndarray
    force: np.ndarray
    correction: np.ndarray
    pressed: np.ndarray
    stored: np.ndarray
    stuck: np.ndarray
    lost: np.ndarray

    @classmethod
    def of_size(cls, n: int) -> "Touched":
        """Arrays for n particles."""
        vectors, numbers = [np.zeros((n, 3)) for _ in range(3)], [np.zeros(n) for _ in range(4)]
        return cls(np.zeros(n, np.int64), *vectors, *numbers)

    def first(self, count: int) -> "Touched":
        """Views of the first rows."""
        return Touched(*(array[:count] for array in self))


class Approach(NamedTuple):
    """A time [s] and the greatest speed [m/s] of the tool's points, which bound the approach of particles and tool;
    step_time, step_speed: the same for particles that bound the step."""

    time: float
    speed: float
    step_time: float
    step_speed: float


@inlined
def _to_frame(frame, a):
    """Components in the frame of the tool of a vector in space."""
    R = frame.rotation
    return (
        R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2],
        R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2],
        R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2],
    )


@inlined
def _to_space(frame, a):
    """Components in space of a vector in the frame of the tool."""
    R = frame.rotation
    return (
        R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2],
        R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2],
        R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2],
    )


@register_jitable
def _vector(rows, i, first, d):
    """Vector of d numbers of a row, from the column `first` on."""
    return rows[i, first], rows[i, first + 1] if d > 1 else 0.0, rows[i, first + 2] if d > 2 else 0.0


@register_jitable
def _put(rows, i, first, d, vector):
    rows[i, first] = vector[0]
    if d > 1:
        rows[i, first + 1] = vector[1]
    if d > 2:
        rows[i, first + 2] = vector[2]


@register_jitable
def _rub(friction, frame, i, arm, normal, depth, stiffness):
    """Force [N] of friction on a pressed particle, energy of its spring and dissipation [J].

    stiffness [N/m]: of the normal spring, twice that of friction's.
    """
    record, rigidity, lost = friction.record, 0.5 * stiffness, 0.0
    d = (record.shape[1] - 1) // 2
    if friction.slipping:
        if record[i, 0] == 0.0:
            record[i, 0] = 1.0
            _put(record, i, 1, d, _to_frame(frame, arm))
            _put(record, i, 1 + d, d, (0.0, 0.0, 0.0))
        before, anchor = _vector(record, i, 1 + d, d), _to_space(frame, _vector(record, i, 1, d))
        trial = tangential(combined(1.0, arm, -1.0, anchor), normal)
        stretch, lost = return_mapping(before, trial, rigidity, friction.coefficient * stiffness * depth)
        if stretch != trial:
            _put(record, i, 1, d, _to_frame(frame, combined(1.0, arm, -1.0, stretch)))
        _put(record, i, 1 + d, d, stretch)
    stretch = _vector(record, i, 1 + d, d)
    return combined(-rigidity, stretch, 0.0, stretch), 0.5 * rigidity * dot(stretch, stretch), lost


@register_jitable
def _let_go(friction, i, stiffness):
    """Clear the record of a particle; returns the energy of its spring [J]."""
    record = friction.record
    d = (record.shape[1] - 1) // 2
    stretch = _vector(record, i, 1 + d, d)
    record[i, :] = 0.0
    return 0.25 * stiffness * dot(stretch, stretch)


@kernel
def press(shape, frame, friction, alpha, particles, approach, known, touched):
    """Forces of a shape on particles, into the first rows of `touched`.

    alpha: factor on the stiffness; friction: None without any; known: whether particles.level is that of the last step.
    Returns the number of rows; of all particles that the tool may touch in the time of `approach`, the sums of the
    stiffnesses [N/m], and of these times squared arms [N m] (normal and tangential springs); the least distance [m] of
    a particle's face from the shape, negative where it touches; the greatest `square` of particles that bound the step.
    """
    count, clearance, together, turning, square = 0, math.inf, 0.0, 0.0, 0.0
    position, level, d = particles.position, particles.level, particles.position.shape[1]
    for i in range(particles.owned):
        if not particles.touchable[particles.body[i]]:
            continue
        x, v = _vector(position, i, 0, d), _vector(particles.velocity, i, 0, d)
        arm = (x[0] - frame.place[0], x[1] - frame.place[1], x[2] - frame.place[2])
        local, stiffness = _to_frame(frame, arm), alpha * particles.stiffness[i]
        before = level[i] if known else 0.0
        own = math.sqrt(dot(v, v))
        reach = approach.time * (approach.speed + own)
        near = approach.step_time * (approach.step_speed + own)
        # where a gap has just opened, the normal is needed
        look = math.inf if before > 0.0 else particles.radius[i] + max(reach, near)
        away, nx, ny, nz = distance(shape, local[0], local[1], local[2], look)
        depth = particles.radius[i] - away
        correction = stiffness * gap_correction(before, depth) if known else 0.0
        level[i] = depth
        clearance = min(clearance, -depth)
        if depth >= -near:
            square = max(square, particles.square[i])
        if depth > -reach:
            # the tangential spring of friction has half the stiffness
            share = 0.0 if friction is None else 0.5
            p, q, r = local[1] * nz - local[2] * ny, local[2] * nx - local[0] * nz, local[0] * ny - local[1] * nx
            lever = p * p + q * q + r * r
            together += stiffness
            turning += stiffness * (lever + share * (dot(local, local) - lever))
        force, stored, stuck, lost = (0.0, 0.0, 0.0), 0.0, 0.0, 0.0
        normal = _to_space(frame, (nx, ny, nz))
        if depth > 0.0:
            push = stiffness * depth
            force, stored = combined(push, normal, 0.0, normal), 0.5 * push * depth
            if friction is not None:
                drag, stuck, lost = _rub(friction, frame, i, arm, normal, depth, stiffness)
                force = combined(1.0, force, 1.0, drag)
        elif friction is not None:
            lost = _let_go(friction, i, stiffness)
        if depth > 0.0 or before > 0.0 or lost > 0.0:
            touched.row[count], touched.pressed[count] = i, 1.0 if depth > 0.0 else 0.0
            touched.stored[count], touched.stuck[count], touched.lost[count] = stored, stuck, lost
            _put(touched.arm, count, 0, 3, arm)
            _put(touched.force, count, 0, 3, force)
            _put(touched.correction, count, 0, 3, combined(correction, normal, 0.0, normal))
            count += 1
    return count, together, turning, clearance, square


@kernel
def fastest(owned, velocity):
    """The greatest speed [m/s]; NaN where one is."""
    most = 0.0
    for i in range(owned):
        square = 0.0
        for k in range(velocity.shape[1]):
            square += velocity[i, k] * velocity[i, k]
        if not square <= most:
            most = square
    return math.sqrt(most)


class Resultant(NamedTuple):
    """Sums over the particles that a tool touches: force (3,) [N], moment (3,) [N m] about its place, the same of the
    corrections (more_); energies [J]; number of pressed particles; sums of stiffnesses, see `press`."""

    force: np.ndarray
    moment: np.ndarray
    more_force: np.ndarray
    more_moment: np.ndarray
    stored: float
    stuck: float
    lost: float
    pressed: float
    stiffness: float
    turning: float

    @classmethod
    def none(cls) -> "Resultant":
        """Of a tool that touches nothing."""
        return cls.from_numbers(np.zeros(18))

    @classmethod
    def of(cls, touched: Touched, stiffness: float, turning: float) -> "Resultant":
        """The sums over touched particles."""
        moment, more_moment = (np.cross(touched.arm, force) for force in (touched.force, touched.correction))
        vectors = touched.force, moment, touched.correction, more_moment
        numbers = touched.stored, touched.stuck, touched.lost, touched.pressed
        sums: list[Any] = [one.sum(axis=0) for one in (*vectors, *numbers)]
        return cls._make([*sums, stiffness, turning])

    @property
    def numbers(self) -> np.ndarray:
        """All numbers (18,), for sums."""
        return np.concatenate([np.ravel(one) for one in self])

    @classmethod
    def from_numbers(cls, numbers: np.ndarray) -> "Resultant":
        """From the array of `numbers`."""
        return cls(*numbers[:12].reshape(4, 3), *map(float, numbers[12:]))
