"""Forces between particles and a rigid shape: a potential of the signed distance, and friction that sticks elastically.

    U = sum 1/2 k_i g_i^2,  g_i = max(0, r_i - d(x_i)),  k_i = alpha M V_i/h_i^2 (of a node on a face alpha M A_i/h_i)

so the force k_i g_i along the gradient of d is exact, and the tool takes its opposite at the place of the particle.
Friction keeps for each particle the place on the tool where it took hold and the stretch xi of the spring k_i/2 from
there, which slips where the spring would pull by more than mu f_n (Cundall and Strack 1979).
"""

import math
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.passes import crossing
from parsolid.contact.tools.shapes import distance
from parsolid.kernels import kernel

# places in `press`'s sums: force, moment about the tool's place, energies [J], stiffness of all particles together, how
# many there are; force and moment that the impulse at the end of the step has besides
FORCE, MOMENT = slice(0, 3), slice(3, 6)
STORED, STUCK, LOST, STIFFNESS, TURNING, COUNT = 6, 7, 8, 9, 10, 11
MORE_FORCE, MORE_MOMENT = slice(12, 15), slice(15, 18)
SUMS = 18


class Frame(NamedTuple):
    """Place (3,) [m] and rotation (3, 3) of a tool."""

    place: np.ndarray
    rotation: np.ndarray


class Friction(NamedTuple):
    """Coefficient; record (rows, 1 + 2 d): whether a particle holds, where in the frame of the tool, xi [m]; slipping:
    whether records follow the motion, or forces of what is recorded are asked for."""

    coefficient: float
    record: np.ndarray
    slipping: bool


class Resistance(NamedTuple):
    """Of each particle the radius r [m] and the stiffness k [N/m] of a tool with alpha = 1; factor: alpha."""

    radius: np.ndarray
    stiffness: np.ndarray
    factor: float


@register_jitable
def _to_frame(frame, x, y, z):
    """A place in the frame of the tool."""
    R, a, b, c = frame.rotation, x - frame.place[0], y - frame.place[1], z - frame.place[2]
    return (
        R[0, 0] * a + R[1, 0] * b + R[2, 0] * c,
        R[0, 1] * a + R[1, 1] * b + R[2, 1] * c,
        R[0, 2] * a + R[1, 2] * b + R[2, 2] * c,
    )


@register_jitable
def _turned(R, a, b, c):
    """R (a, b, c)."""
    return (
        R[0, 0] * a + R[0, 1] * b + R[0, 2] * c,
        R[1, 0] * a + R[1, 1] * b + R[1, 2] * c,
        R[2, 0] * a + R[2, 1] * b + R[2, 2] * c,
    )


@register_jitable
def _component(places, i, k):
    return places[i, k] if k < places.shape[1] else 0.0


@register_jitable
def _let_go(friction, stiffness, i):
    """Forget what a particle held; the energy of its spring [J]."""
    record = friction.record
    d = (record.shape[1] - 1) // 2
    energy = 0.0
    for k in range(1 + d, 1 + 2 * d):
        energy += record[i, k] * record[i, k]
    record[i, :] = 0.0
    return 0.25 * stiffness * energy


@register_jitable
def _hold(friction, frame, i, x, y, z):
    """Let a particle take hold where it is."""
    record = friction.record
    d = (record.shape[1] - 1) // 2
    here = _to_frame(frame, x, y, z)
    record[i, 0] = 1.0
    for k in range(d):
        record[i, 1 + k], record[i, 1 + d + k] = here[k], 0.0


@register_jitable
def _stretch(friction, frame, i, x, y, z, n, most):
    """xi after the motion, at most as long as friction holds [m], and the energy lost over the stiffness [m^2].

    The loss is that of the mean of the forces before and after, exact for slip in one direction.
    """
    record = friction.record
    d = (record.shape[1] - 1) // 2
    third = record[i, 3] if d == 3 else 0.0
    ax, ay, az = _turned(frame.rotation, record[i, 1], record[i, 2], third)
    a, b, c = x - frame.place[0] - ax, y - frame.place[1] - ay, z - frame.place[2] - az
    across = a * n[0] + b * n[1] + c * n[2]
    a, b, c = a - across * n[0], b - across * n[1], c - across * n[2]
    long = math.sqrt(a * a + b * b + c * c)
    lost = 0.0
    if long > most:
        keep = most / long
        oa, ob, oc = record[i, 1 + d], record[i, 2 + d], record[i, 3 + d] if d == 3 else 0.0
        sa, sb, sc = (1.0 - keep) * a, (1.0 - keep) * b, (1.0 - keep) * c
        a, b, c = keep * a, keep * b, keep * c
        lost = max(0.0, 0.5 * ((oa + a) * sa + (ob + b) * sb + (oc + c) * sc))
        here = _to_frame(frame, x - a, y - b, z - c)
        for k in range(d):
            record[i, 1 + k] = here[k]
    record[i, 1 + d], record[i, 2 + d] = a, b
    if d == 3:
        record[i, 3 + d] = c
    return lost


@register_jitable
def _pull(friction, frame, i, x, y, z, n, depth, k, sums):
    """The force [N] of a particle's spring, which has half the stiffness k; its energies go to the sums."""
    d = (friction.record.shape[1] - 1) // 2
    if friction.slipping:
        if friction.record[i, 0] == 0.0:
            _hold(friction, frame, i, x, y, z)
        most = 2.0 * friction.coefficient * depth
        sums[LOST] += 0.5 * k * _stretch(friction, frame, i, x, y, z, n, most)
    a, b = friction.record[i, 1 + d], friction.record[i, 2 + d]
    c = friction.record[i, 3 + d] if d == 3 else 0.0
    sums[STUCK] += 0.25 * k * (a * a + b * b + c * c)
    return -0.5 * k * a, -0.5 * k * b, -0.5 * k * c


@register_jitable
def _put(vector, place, x, y, z):
    """Three numbers into the components that a row has."""
    vector[place, 0] = x
    if vector.shape[1] > 1:
        vector[place, 1] = y
    if vector.shape[1] > 2:
        vector[place, 2] = z


@register_jitable
def _add_up(sums, first, a, b, c, fx, fy, fz):
    """A force and its moment by the arm (a, b, c) to sums from a place on."""
    total = (fx, fy, fz, b * fz - c * fy, c * fx - a * fz, a * fy - b * fx)
    for m in range(6):
        sums[first + m] += total[m]


@register_jitable
def _force(friction, frame, i, x, y, z, n, depth, k, heat, sums):
    """The force [N] on a particle of a depth [m], three components; its energies, and what friction takes of it."""
    fx, fy, fz, lost = 0.0, 0.0, 0.0, sums[LOST]
    if depth > 0.0:
        push = k * depth
        fx, fy, fz = push * n[0], push * n[1], push * n[2]
        sums[STORED] += 0.5 * push * depth
        if friction is not None:
            tx, ty, tz = _pull(friction, frame, i, x, y, z, n, depth, k, sums)
            fx, fy, fz = fx + tx, fy + ty, fz + tz
    elif friction is not None:
        sums[LOST] += _let_go(friction, k, i)
    if heat is not None:
        heat[i] = sums[LOST] - lost
    return fx, fy, fz


class Approach(NamedTuple):
    """How far particles and tool may come nearer: a time [s], the greatest speed of the tool's points [m/s], and the
    velocities (n, d) of the particles."""

    time: float
    speed: float
    velocity: np.ndarray


@register_jitable
def _speed(velocity, i):
    square = 0.0
    for k in range(velocity.shape[1]):
        square += velocity[i, k] * velocity[i, k]
    return math.sqrt(square)


@kernel
def press(
    shape, frame, friction, resistance, owned, places, body, meant, rows, forces, heat, level, new, sums, approach
):
    """Forces (2, owned, d) [N] on the `rows` of particles that a shape touches, and their `sums` as named above: the
    force, and what the impulse at the end of the step has besides, see `passes.crossing`.

    meant (bodies,): bodies that it is for; heat (owned,): what friction takes of each [J], or None; level (owned,): how
    deep [m] each is, below zero where it is apart, of the last call unless `new`. Stiffnesses are those of all
    particles that the shape may touch in the time of `approach`. Returns how many rows there are, the
    least distance [m] of any face of a particle from the shape (below zero where it touches).
    """
    count, clearance = 0, math.inf
    sums[:] = 0.0
    for i in range(owned):
        if heat is not None:
            heat[i] = 0.0
        if not meant[body[i]]:
            continue
        x, y, z = _component(places, i, 0), _component(places, i, 1), _component(places, i, 2)
        radius = resistance.radius[i]
        u, v, w = _to_frame(frame, x, y, z)
        pressed = level[i] > 0.0 and not new
        reach = approach.time * (approach.speed + _speed(approach.velocity, i))
        # of what has just parted the direction counts, too
        away, nx, ny, nz = distance(shape, u, v, w, math.inf if pressed else radius + reach)
        depth, k = radius - away, resistance.factor * resistance.stiffness[i]
        clearance = min(clearance, -depth)
        more = 0.0 if new else k * crossing(level[i], depth)
        level[i] = depth
        if depth > -reach:
            # the tangential spring of friction has half the stiffness
            share = 0.0 if friction is None else 0.5
            p, q, r = v * nz - w * ny, w * nx - u * nz, u * ny - v * nx
            lever = p * p + q * q + r * r
            sums[STIFFNESS] += k
            sums[TURNING] += k * (lever + share * (u * u + v * v + w * w - lever))
        if friction is None and not (depth > 0.0 or pressed):
            continue
        n = _turned(frame.rotation, nx, ny, nz)
        fx, fy, fz = _force(friction, frame, i, x, y, z, n, depth, k, heat, sums)
        if not (depth > 0.0 or pressed):
            continue
        a, b, c = x - frame.place[0], y - frame.place[1], z - frame.place[2]
        rows[count] = i
        _put(forces[0], count, fx, fy, fz)
        _put(forces[1], count, more * n[0], more * n[1], more * n[2])
        count += 1
        _add_up(sums, 0, a, b, c, fx, fy, fz)
        _add_up(sums, 12, a, b, c, more * n[0], more * n[1], more * n[2])
    sums[COUNT] = count
    return count, clearance


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
