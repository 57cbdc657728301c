"""Forces between particles and a rigid shape: a potential of the signed distance, and friction that sticks elastically.

    U = sum 1/2 k_i g_i^2,  g_i = max(0, r_i - d(x_i)),  k_i = alpha M V_i/h_i^2 (of a node on a face alpha M A_i/h_i)

so the force k_i g_i along the gradient of d is exact, and the tool takes its opposite at the place of the particle.
Friction records for each particle its point of adhesion on the tool and the stretch xi of a spring k_i/2 from there.
The point slips where the spring would pull by more than mu f_n (`contact.friction`).
"""

import math
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.friction import combined, dot, gap_correction, return_mapping, tangential
from parsolid.contact.tools.shapes import MESH, Shape, plain_distance
from parsolid.contact.tools.surface import surface_distance
from parsolid.kernels import inlined, kernel

# number of the longest steps within which particles that may be touched bound the step
_NEAR = 2.0
# Sums over the particles that a tool touches: force [N] on them and its moment [N m] about the tool's place; the same
# of the corrections (closing_) of the impulse over half the step, see `friction.gap_correction`; energies [J] of the
# penetrations and of the springs of friction, and the dissipation by friction; number of particles in the tool. Of all
# particles that it may touch within the longest step, the sums of the stiffnesses [N/m], and of these times squared
# arms [N m] (normal and tangential springs).
RESULTANT = np.dtype(
    [(name, "f8", 3) for name in ("force", "moment", "closing_force", "closing_moment")]
    + [(name, "f8") for name in ("stored", "stuck", "lost", "pressed", "stiffness", "turning")]
)


class RigidShape(NamedTuple):
    """A tool: its shape, place (3,) [m], rotation (3, 3), factor alpha on stiffnesses, coefficient of friction; the
    greatest speed [m/s] of its points; a time [s] longer than any stable step, 0 to look at no approach."""

    shape: Shape
    place: np.ndarray
    rotation: np.ndarray
    alpha: float
    friction: float
    speed: float
    longest: float


class Particles(NamedTuple):
    """Owned particles, which a tool may touch where touchable (bodies,) of their body (n,) is true.

    position [m], velocity [m/s] (n, d); radius (n,) [m]; stiffness (n,) [N/m] for alpha = 1; square (n,) [1/s^2]: of
    the angular frequency on the spring of the contact; level (n,) [m]: depth in the tool in the last call, negative
    outside; record (n, 1 + 2 d): whether a particle adheres, its point [m] in the frame of the tool, xi [m], unused
    without friction. Results: force [N], impulse [N s] (n, d), to which the tool's are added, and lost (n,) [J]:
    dissipated by friction.
    """

    owned: int
    body: np.ndarray
    touchable: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    radius: np.ndarray
    stiffness: np.ndarray
    square: np.ndarray
    level: np.ndarray
    record: np.ndarray
    force: np.ndarray
    impulse: np.ndarray
    lost: np.ndarray


@inlined
def _to_frame(R, a):
    """Components in the frame of the tool of a vector in space."""
    return (
        R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2],
        R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2],
        R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2],
    )


@inlined
def _to_space(R, a):
    """Components in space of a vector in the frame of the tool."""
    return (
        R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2],
        R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2],
        R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2],
    )


@inlined
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


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
def _friction(tool, record, i, d, follows, arm, normal, depth, stiffness):
    """Force [N] of friction on a pressed particle, energy of its spring and dissipation [J].

    follows: whether the record follows the motion, or is kept; stiffness [N/m]: of the normal spring, twice that of
    friction's.
    """
    R, rigidity, lost = tool.rotation, 0.5 * stiffness, 0.0
    if follows:
        if record[i, 0] == 0.0:
            record[i, 0] = 1.0
            _put(record, i, 1, d, _to_frame(R, arm))
            _put(record, i, 1 + d, d, (0.0, 0.0, 0.0))
        before, anchor = _vector(record, i, 1 + d, d), _to_space(R, _vector(record, i, 1, d))
        trial = tangential(combined(1.0, arm, -1.0, anchor), normal)
        stretch, lost = return_mapping(before, trial, rigidity, tool.friction * stiffness * depth)
        if stretch != trial:
            _put(record, i, 1, d, _to_frame(R, combined(1.0, arm, -1.0, stretch)))
        _put(record, i, 1 + d, d, stretch)
    stretch = _vector(record, i, 1 + d, d)
    return combined(-rigidity, stretch, 0.0, stretch), 0.5 * rigidity * dot(stretch, stretch), lost


@kernel
def press(tool, particles, signal, known, follows, half_step, resultant):
    """Forces of a tool on particles, and their sums, added to resultant (1,) of the type `RESULTANT`.

    signal: speed [m/s] of waves in particles; known: whether particles.level is that of the last step; follows: whether
    friction follows the motion, or keeps its record; half_step [s]: the time over which corrections of the impulse act.
    Returns the least distance [m] of a particle's face from the shape, negative where it touches, and the greatest
    `square` of particles that bound the step.
    """
    clearance, square, sums = math.inf, 0.0, resultant[0]
    position, level, record, d = particles.position, particles.level, particles.record, particles.position.shape[1]
    rubs = tool.friction > 0.0
    # arrays of a record that is passed in the loop would be counted anew for each particle
    kind, axis, size, surface = tool.shape
    for i in range(particles.owned):
        if not particles.touchable[particles.body[i]]:
            continue
        x, v = _vector(position, i, 0, d), _vector(particles.velocity, i, 0, d)
        arm = (x[0] - tool.place[0], x[1] - tool.place[1], x[2] - tool.place[2])
        local, stiffness = _to_frame(tool.rotation, arm), tool.alpha * particles.stiffness[i]
        before = level[i] if known else 0.0
        approach = tool.speed + math.sqrt(dot(v, v))
        reach, near = tool.longest * approach, _NEAR * tool.longest * (signal + approach)
        # where a gap has just opened, the normal is needed
        look = math.inf if before > 0.0 else particles.radius[i] + near
        if kind == MESH:
            away, nx, ny, nz = surface_distance(surface, local[0], local[1], local[2], look)
        else:
            away, nx, ny, nz = plain_distance(kind, axis, size, local[0], local[1], local[2])
        depth = particles.radius[i] - away
        level[i] = depth
        clearance = min(clearance, -depth)
        if depth >= -near:
            square = max(square, particles.square[i])
        if depth > -reach:
            # the tangential spring of friction has half the stiffness
            lever = _cross(local, (nx, ny, nz))
            turning = dot(lever, lever)
            sums.stiffness += stiffness
            sums.turning += stiffness * (turning + (0.5 if rubs else 0.0) * (dot(local, local) - turning))
        force, stuck, lost = (0.0, 0.0, 0.0), 0.0, 0.0
        normal = _to_space(tool.rotation, (nx, ny, nz))
        if depth > 0.0:
            push = stiffness * depth
            force = combined(push, normal, 0.0, normal)
            if rubs:
                drag, stuck, lost = _friction(tool, record, i, d, follows, arm, normal, depth, stiffness)
                force = combined(1.0, force, 1.0, drag)
            sums.stored += 0.5 * push * depth
            sums.pressed += 1.0
        elif rubs and record[i, 0] != 0.0:
            # the spring ends
            stretch = _vector(record, i, 1 + d, d)
            lost = 0.25 * stiffness * dot(stretch, stretch)
            record[i, :] = 0.0
        particles.lost[i] = lost
        if depth > 0.0 or before > 0.0:
            correction = combined(stiffness * gap_correction(before, depth) if known else 0.0, normal, 0.0, normal)
            moment, closing = _cross(arm, force), _cross(arm, correction)
            for k in range(3):
                sums.force[k] += force[k]
                sums.moment[k] += moment[k]
                sums.closing_force[k] += correction[k]
                sums.closing_moment[k] += closing[k]
            for k in range(d):
                particles.force[i, k] += force[k]
                particles.impulse[i, k] += half_step * correction[k]
        sums.stuck += stuck
        sums.lost += lost
    return clearance, square
