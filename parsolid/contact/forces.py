"""Kernels of contact: penetrations with their energy, normal forces, friction and its heat.

    c_a = sum over the other body of V_b W(|x_a - x_b|),   g_a = max(0, c_a - c0_a)/s_a,   U = sum kappa A_a g_a^2/4

A candidate is a particle together with one of the bodies that its own body may touch. Rows: owned ones first, ghosts
behind. Sums run in the order of the pairs, which is that of identifiers, so that they do not depend on ranks. The terms
of a sum are computed in one loop and added in a second, so that pairs out of reach change no bits.
"""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from parsolid.contact.friction import (
    combined,
    dot,
    gap_correction,
    linear_return,
    linear_weights,
    return_mapping,
    tangential,
    turned,
)
from parsolid.contact.kernel import shape, slope
from parsolid.kernels import inlined, kernel

# branch of a candidate's force, fixed where differences of forces have to be linear: apart, pressed without slip,
# pressed with the slip of the last trial; FREE: by the present penetration and traction
APART, STICKS, PRESSED, FREE = 0, 1, 2, -1
# in place of a distance of 0
_NONE = 1e-300
# share of the threshold: least colour of a candidate that has parted, for weights exact for linear fields
_GONE = 0.5


class Candidates(NamedTuple):
    """Candidates of a rank, owned ones first.

    All (n,): rows (n, 4): position [m], zero beyond the dimension, and whole volume [m^3]; moved (n, 3) [m]:
    displacement in the last step. Owned (m,): share of the particle on this side of symmetry planes; threshold c0;
    per_slope 1/s [m]; stiffness kappa A/2 [N/m]; per_reach 1/R [1/m]; norm N R^-d [1/m^d].
    """

    rows: np.ndarray
    moved: np.ndarray
    share: np.ndarray
    threshold: np.ndarray
    per_slope: np.ndarray
    stiffness: np.ndarray
    per_reach: np.ndarray
    norm: np.ndarray
    dimension: int


class Pairs(NamedTuple):
    """Neighbours of candidate a are neighbour[start[a]] .. neighbour[start[a + 1] - 1].

    image (pairs,): 0, or the number of the image of the neighbour behind symmetry planes; mirrors (2, images, 4): R and
    T of R x + T; both None without planes. active (m,): whether a may press.
    """

    start: np.ndarray
    neighbour: np.ndarray
    image: Any
    mirrors: Any
    active: np.ndarray


class Pressure(NamedTuple):
    """Normal forces of candidates.

    Owned (m,): colour c; penetration [m], negative before faces meet; branch: APART, STICKS, PRESSED or FREE. All (n,):
    pull kappa A g/(2 s) [N]; correction [N]: of the impulse over half the step, see `friction.gap_correction`.
    """

    colour: np.ndarray
    penetration: np.ndarray
    branch: np.ndarray
    pull: np.ndarray
    correction: np.ndarray


class Friction(NamedTuple):
    """Friction of candidates.

    Owned (m,): coefficient, 0 without friction; stretch (m, 3) [m] of the spring; lost [J]: dissipated in the step by
    the part on this side of planes; trial (m, 3) [m], most [N]: stretch without slip and Coulomb's limit of the last
    trial on the branch FREE. All (n,): per_colour 1/c, 0 without friction; traction (n, 3) [N]; tilt (n, 3) [1/m] and
    centre (n, 3) [m] of weights exact for linear fields, V W/c [1 + tilt . (x - centre)] of particles of the other
    body; given [J]: heat for the other body, over c.
    """

    coefficient: np.ndarray
    stretch: np.ndarray
    lost: np.ndarray
    trial: np.ndarray
    most: np.ndarray
    per_colour: np.ndarray
    traction: np.ndarray
    tilt: np.ndarray
    centre: np.ndarray
    given: np.ndarray


# --- pairs ----------------------------------------------------------------------------------------------------------


@inlined
def _vector(array, b):
    return array[b, 0], array[b, 1], array[b, 2]


@inlined
def _imaged(image, mirrors, k, vector, shift):
    """A vector of the neighbour in pair k, or of its image; shift: 1 for a position, else 0."""
    if image is None:
        return vector
    R, T = mirrors[0, image[k]], mirrors[1, image[k]]
    return (
        R[0] * vector[0] + shift * T[0],
        R[1] * vector[1] + shift * T[1],
        R[2] * vector[2] + shift * T[2],
    )


@inlined
def _apart(points, pairs, a, k):
    """x_a - x_b [m] in pair k of candidate a."""
    other = _imaged(pairs.image, pairs.mirrors, k, _vector(points.rows, pairs.neighbour[k]), 1.0)
    return points.rows[a, 0] - other[0], points.rows[a, 1] - other[1], points.rows[a, 2] - other[2]


@register_jitable
def _longest(start):
    most = 0
    for a in range(len(start) - 1):
        most = max(most, start[a + 1] - start[a])
    return most


# --- normal forces --------------------------------------------------------------------------------------------------


@kernel
def may_press(points, pairs, skin, share):
    """1 for owned candidates whose colour may exceed a share of their threshold where pairs approach by a skin (m,)
    [m], else 0."""
    result = np.zeros(len(points.share), np.int64)
    for a in range(len(result)):
        most = 0.0
        for k in range(pairs.start[a], pairs.start[a + 1]):
            u = _apart(points, pairs, a, k)
            q = max(dot(u, u) ** 0.5 - skin[a], 0.0) * points.per_reach[a]
            most += points.rows[pairs.neighbour[k], 3] * shape(min(q, 1.0))
        result[a] = most * points.norm[a] > share * points.threshold[a]
    return result


@kernel
def find_penetrations(points, pairs, known, pressure):
    """Colours, penetrations and pulls of the owned candidates; known: whether `pressure` holds the penetrations at the
    start of the step. Returns the stored energy [J], the deepest penetration [m] and its candidate."""
    energy, deepest, where, seen = 0.0, 0.0, -1, np.empty(_longest(pairs.start))
    for a in range(len(points.share)):
        per_reach = points.per_reach[a]
        pressure.pull[a] = pressure.correction[a] = pressure.colour[a] = 0.0
        if not pairs.active[a]:
            pressure.penetration[a] = -1.0 / per_reach
            continue
        first, count = pairs.start[a], pairs.start[a + 1] - pairs.start[a]
        for k in range(count):
            u = _apart(points, pairs, a, first + k)
            volume = points.rows[pairs.neighbour[first + k], 3]
            seen[k] = volume * shape((u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) ** 0.5 * per_reach)
        total = 0.0
        for k in range(count):
            total += seen[k]
        pressure.colour[a] = total * points.norm[a]
        now = (pressure.colour[a] - points.threshold[a]) * points.per_slope[a]
        factor = points.stiffness[a] * points.per_slope[a]
        if known:
            pressure.correction[a] = factor * gap_correction(pressure.penetration[a], now)
        pressed = now > 0.0 if pressure.branch[a] == FREE else pressure.branch[a] != APART
        pressure.penetration[a], depth = now, now if pressed else 0.0
        pressure.pull[a] = factor * depth
        energy += 0.5 * points.share[a] * points.stiffness[a] * depth * depth
        if depth > deepest:
            deepest, where = depth, a
    return energy, deepest, where


@kernel
def normal_forces(points, pairs, pull, force):
    """Forces (m, 3) [N] on the owned candidates by the pulls (n,) [N]: the gradient of the energy, central in each
    pair; on the whole particle where a symmetry plane cuts it. Returns whether any is not zero."""
    acts, push = False, np.empty((3, _longest(pairs.start)))
    force[:] = 0.0
    for a in range(len(pull)):
        acts = acts or pull[a] != 0.0
    if not acts:
        return acts
    for a in range(len(force)):
        first, count = pairs.start[a], pairs.start[a + 1] - pairs.start[a]
        mine, volume, presses = pull[a], points.rows[a, 3], pull[a] != 0.0
        for k in range(count):
            presses = presses or pull[pairs.neighbour[first + k]] != 0.0
        if not presses:
            continue
        per_reach = points.per_reach[a]
        factor = -points.norm[a] * per_reach
        for k in range(count):
            b, u = pairs.neighbour[first + k], _apart(points, pairs, a, first + k)
            length = max((u[0] * u[0] + u[1] * u[1] + u[2] * u[2]) ** 0.5, _NONE)
            over = factor * slope(length * per_reach) * (mine * points.rows[b, 3] + pull[b] * volume) / length
            push[0, k], push[1, k], push[2, k] = over * u[0], over * u[1], over * u[2]
        for i in range(3):
            total = 0.0
            for k in range(count):
                total += push[i, k]
            force[a, i] = total
    return acts


# --- friction -------------------------------------------------------------------------------------------------------


@register_jitable
def _neighbourhood(points, pairs, a, scale):
    """Of the other body around candidate a: unit normal away from it, |grad c| R/(N R^-d), sums of the weights V W/c
    times x_b - x_a (3) [m] and times its products (6) [m^2]; scale: N R^-d/c."""
    nx, ny, nz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    per_reach = points.per_reach[a]
    for k in range(pairs.start[a], pairs.start[a + 1]):
        x, y, z = _apart(points, pairs, a, k)
        q = (x * x + y * y + z * z) ** 0.5 * per_reach
        if q < 1.0:
            volume = points.rows[pairs.neighbour[k], 3]
            part, pull = scale * volume * shape(q), volume * slope(q) * per_reach / max(q, _NONE)
            nx, ny, nz = nx - pull * x, ny - pull * y, nz - pull * z
            mx, my, mz = mx - part * x, my - part * y, mz - part * z
            xx, xy, xz = xx + part * x * x, xy + part * x * y, xz + part * x * z
            yy, yz, zz = yy + part * y * y, yz + part * y * z, zz + part * z * z
    length = (nx * nx + ny * ny + nz * nz) ** 0.5
    over = 1.0 / max(length, _NONE)
    return (over * nx, over * ny, over * nz), length, (mx, my, mz), (xx, xy, xz, yy, yz, zz)


@register_jitable
def _slip(points, pairs, a, scale, mean, tilt):
    """Displacement [m] of candidate a in the step, relative to the other body at its position."""
    slip, per_reach = _vector(points.moved, a), points.per_reach[a]
    for k in range(pairs.start[a], pairs.start[a + 1]):
        u, b = _apart(points, pairs, a, k), pairs.neighbour[k]
        q = dot(u, u) ** 0.5 * per_reach
        if q < 1.0:
            part = (1.0 - dot(tilt, u) - dot(tilt, mean)) * scale * points.rows[b, 3] * shape(q)
            moved = _imaged(pairs.image, pairs.mirrors, k, _vector(points.moved, b), 0.0)
            slip = combined(1.0, slip, -part, moved)
    return slip


@register_jitable
def _released(points, pairs, a, follows, colour, friction):
    """Energy [J] that friction dissipates where a candidate parts and its spring ends: the energy of the spring less
    the work of its half impulse in the step, at least 0."""
    stretch = _vector(friction.stretch, a)
    whole, worked = dot(stretch, stretch), 0.0
    # no weights are exact where the colour is too small
    if follows and whole > 0.0 and colour > _GONE * points.threshold[a]:
        scale = points.norm[a] / colour
        friction.per_colour[a] = 1.0 / colour
        _, _, mean, second = _neighbourhood(points, pairs, a, scale)
        tilt = linear_weights(points.dimension, mean, second)
        worked = dot(stretch, _slip(points, pairs, a, scale, mean, tilt))
    friction.stretch[a, :] = 0.0
    return max(0.5 * points.stiffness[a] * (whole + worked), 0.0)


@kernel
def friction_tractions(points, pairs, follows, pressure, friction):
    """Tractions of the owned candidates that press, the weights of their reactions, and the energy dissipated.

    follows: whether springs are stretched by the motion of the step, or keep their stretch. Returns the energy of all
    springs [J].
    """
    stored = 0.0
    for a in range(len(points.share)):
        stiffness, colour, share = points.stiffness[a], pressure.colour[a], points.share[a]
        friction.per_colour[a], friction.lost[a], friction.given[a] = 0.0, 0.0, 0.0
        friction.traction[a, :], friction.tilt[a, :], friction.centre[a, :] = 0.0, 0.0, 0.0
        pressed = pressure.pull[a] > 0.0 if pressure.branch[a] == FREE else pressure.branch[a] != APART
        if not (pressed and friction.coefficient[a] > 0.0):
            friction.lost[a] = share * _released(points, pairs, a, follows, colour, friction)
            continue
        scale = points.norm[a] / colour
        normal, length, mean, second = _neighbourhood(points, pairs, a, scale)
        tilt = linear_weights(points.dimension, mean, second)
        stretch = _vector(friction.stretch, a)
        if follows:
            slip = tangential(_slip(points, pairs, a, scale, mean, tilt), normal)
            before = turned(stretch, normal)
            trial = combined(1.0, before, 1.0, slip)
            most = friction.coefficient[a] * pressure.pull[a] * length * points.norm[a] * points.per_reach[a]
            if pressure.branch[a] == PRESSED:
                stretch = linear_return(before, _vector(friction.trial, a), friction.most[a], trial, stiffness, most)
            elif pressure.branch[a] == STICKS:
                stretch = trial
            else:
                friction.trial[a, 0], friction.trial[a, 1], friction.trial[a, 2] = trial
                friction.most[a] = most
                stretch, lost = return_mapping(before, trial, stiffness, most)
                friction.lost[a] = share * lost
        friction.per_colour[a] = 1.0 / colour
        for i in range(3):
            friction.stretch[a, i], friction.traction[a, i] = stretch[i], -stiffness * stretch[i]
            friction.tilt[a, i], friction.centre[a, i] = tilt[i], points.rows[a, i] + mean[i]
        stored += 0.5 * share * stiffness * dot(stretch, stretch)
    return stored


@kernel
def add_tractions(points, pairs, friction, force):
    """Add friction, and its reactions on the other body, to the forces (m, 3) [N]. Weights exact for linear fields
    spread the reactions, so that angular momentum is kept and a rigid rotation of both bodies gives no friction."""
    for a in range(len(force)):
        for i in range(3):
            force[a, i] += friction.traction[a, i]
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            if friction.per_colour[b] > 0.0:
                u = _apart(points, pairs, a, k)
                q = dot(u, u) ** 0.5 * points.per_reach[a]
                if q < 1.0:
                    tilt = _imaged(pairs.image, pairs.mirrors, k, _vector(friction.tilt, b), 0.0)
                    centre = _imaged(pairs.image, pairs.mirrors, k, _vector(friction.centre, b), 1.0)
                    part = 1.0 + dot(tilt, combined(1.0, _vector(points.rows, a), -1.0, centre))
                    part *= points.norm[a] * points.rows[a, 3] * shape(q) * friction.per_colour[b]
                    traction = _imaged(pairs.image, pairs.mirrors, k, _vector(friction.traction, b), 0.0)
                    for i in range(3):
                        force[a, i] -= part * traction[i]


@kernel
def own_heat(share, friction, heat):
    """Heat (m,) [J] of whole particles: half of their dissipation by friction, and all of it where the contact has
    opened; the other half goes to the other body by the weights of the colour (`Friction.given`)."""
    for a in range(len(share)):
        whole = friction.lost[a] / share[a]
        half = 0.5 if friction.per_colour[a] > 0.0 else 0.0
        heat[a] = (1.0 - half) * whole
        friction.given[a] = half * whole * friction.per_colour[a]


@kernel
def add_others_heat(points, pairs, given, heat):
    """Add to heat (m,) [J] the halves from the friction of particles of other bodies."""
    for a in range(len(heat)):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            if given[pairs.neighbour[k]] != 0.0:
                u = _apart(points, pairs, a, k)
                q = dot(u, u) ** 0.5 * points.per_reach[a]
                if q < 1.0:
                    heat[a] += given[pairs.neighbour[k]] * points.norm[a] * points.rows[a, 3] * shape(q)
