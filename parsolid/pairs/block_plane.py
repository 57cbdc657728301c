"""The two passes over lists by blocks in the plane, as `block_passes` has them in space: 18 rows of the window."""

from decomposition.deferred import register_jitable
from parsolid.numerics.lanes import WIDTH, broadcast
from parsolid.numerics.layout import Plane
from parsolid.numerics.wide_lanes import WIDE, broadcast_wide, fused_wide, load_wide
from parsolid.pairs.block_window import (
    NO_DISTANCE,
    add,
    at,
    columns,
    enter_all,
    enter_velocity,
    forces_of_block,
    four,
    give,
    give_forces,
    give_gradients,
    gradients_of_block,
    put,
    take,
)
from parsolid.pairs.terms import KINEMATICS

_FIELD = KINEMATICS[2].field
# first rows of the window: of v, then of the sums (column by column), or of x, P L (column by column), impedances,
# 1/2 grad v (column by column), T and D
_V, _SUMS = 0, 2
_X, _P, _Z, _G, _T, _D = 2, 4, 8, 10, 14, 16


@register_jitable
def _two(window, row, c):
    return at(window, row, c), at(window, row + 1, c)


@register_jitable
def _put_two(window, row, c, first, second):
    put(window, row, c, first)
    put(window, row + 1, c, second)


@register_jitable
def _add_two(window, row, c, values):
    add(window, row, c, values[0])
    add(window, row + 1, c, values[1])


@register_jitable
def _sum(first, second):
    return first[0] + second[0], first[1] + second[1]


# --- gradients ---------------------------------------------------------------------------------------------------


@enter_velocity.of(Plane)
def _enter(space, window, c, kinematics, i):
    v, w, _, _ = columns(kinematics, i, _FIELD)
    _put_two(window, _V, c, v, w)
    for row in range(_SUMS, _SUMS + 4):
        put(window, row, c, broadcast(0.0))


@register_jitable
def _outer(window, row, c, u, g):
    """Add u g to two rows and return it."""
    product = u[0] * g, u[1] * g
    _add_two(window, row, c, product)
    return product


@gradients_of_block.of(Plane)
def _gradients_of_block(space, pairs, pattern, c):
    window, patterns, zero = pairs.window, pairs.patterns, broadcast_wide(0.0)
    v, first, second = _two(window, _V, c), (zero, zero), (zero, zero)
    for k in range(patterns.first[pattern], patterns.first[pattern + 1]):
        b, s = c + patterns.rows[k], patterns.shape[k]
        scale = load_wide(patterns.lanes, 2 * WIDE * k)
        u = at(window, _V, b) - v[0], at(window, _V + 1, b) - v[1]
        g = patterns.shapes[s, 0], patterns.shapes[s, 1]
        if g[0] != 0.0:
            first = _sum(first, _outer(window, _SUMS, b, u, scale * g[0]))
        if g[1] != 0.0:
            second = _sum(second, _outer(window, _SUMS + 2, b, u, scale * g[1]))
    _add_two(window, _SUMS, c, first)
    _add_two(window, _SUMS + 2, c, second)


@give_gradients.of(Plane)
def _give_gradients(space, window, c, sums, i, count):
    first, second = four(window, _SUMS, c), four(window, _SUMS + 1, c)
    give(sums, i, 0, count, first, second, four(window, _SUMS + 2, c), four(window, _SUMS + 3, c))


# --- forces ------------------------------------------------------------------------------------------------------


@enter_all.of(Plane)
def _enter_all(space, window, c, kinematics, record, i):
    v, w, x, y = columns(kinematics, i, _FIELD)
    _put_two(window, _V, c, v, w)
    _put_two(window, _X, c, x, y)
    for row, column in ((_P, 0), (_G, WIDTH)):
        first, second, third, fourth = columns(record, i, column)
        _put_two(window, row, c, first, second)
        _put_two(window, row + 2, c, third, fourth)
    fast, slow, _, _ = columns(record, i, 2 * WIDTH)
    _put_two(window, _Z, c, fast, slow)
    for row in range(_T, _T + 4):
        put(window, row, c, broadcast(0.0))


@register_jitable
def _add_column(window, row, b, own, factor, result):
    """result + (own + that of b) factor."""
    return (
        fused_wide(own[0] + at(window, row, b), factor, result[0]),
        fused_wide(own[1] + at(window, row + 1, b), factor, result[1]),
    )


@register_jitable
def _dot(u, v):
    return fused_wide(u[1], v[1], u[0] * v[0])


@register_jitable
def _take_two(window, row, c, values):
    take(window, row, c, values[0])
    take(window, row + 1, c, values[1])


@forces_of_block.of(Plane)
def _forces_of_block(space, pairs, pattern, c):
    """T, and D = k [Z_s u + (Z_p - Z_s)(u . x) x/|x|^2]."""
    window, patterns, zero = pairs.window, pairs.patterns, broadcast_wide(0.0)
    v, x, fast, slow = _two(window, _V, c), _two(window, _X, c), at(window, _Z, c), at(window, _Z + 1, c)
    P, Q, G, H = _two(window, _P, c), _two(window, _P + 2, c), _two(window, _G, c), _two(window, _G + 2, c)
    stress, dissipation = (zero, zero), (zero, zero)
    for k in range(patterns.first[pattern], patterns.first[pattern + 1]):
        b, s = c + patterns.rows[k], patterns.shape[k]
        scale, jump = load_wide(patterns.lanes, 2 * WIDE * k), load_wide(patterns.lanes, 2 * WIDE * k + WIDE)
        t, u = (zero, zero), (at(window, _V, b) - v[0], at(window, _V + 1, b) - v[1])
        if patterns.shapes[s, 0] != 0.0:
            t = _add_column(window, _P, b, P, scale * patterns.shapes[s, 0], t)
        if patterns.shapes[s, 1] != 0.0:
            t = _add_column(window, _P + 2, b, Q, scale * patterns.shapes[s, 1], t)
        if patterns.shapes[s, WIDTH] != 0.0:
            u = _add_column(window, _G, b, G, patterns.shapes[s, WIDTH], u)
        if patterns.shapes[s, WIDTH + 1] != 0.0:
            u = _add_column(window, _G + 2, b, H, patterns.shapes[s, WIDTH + 1], u)
        y = at(window, _X, b) - x[0], at(window, _X + 1, b) - x[1]
        shear, square = slow + at(window, _Z + 1, b), max(_dot(y, y), NO_DISTANCE)
        normal = jump * ((fast + at(window, _Z, b)) - shear) * _dot(u, y) / square
        shear = jump * shear
        d = fused_wide(shear, u[0], normal * y[0]), fused_wide(shear, u[1], normal * y[1])
        stress, dissipation = _sum(stress, t), _sum(dissipation, d)
        _take_two(window, _T, b, t)
        _take_two(window, _D, b, d)
    _add_two(window, _T, c, stress)
    _add_two(window, _D, c, dissipation)


@give_forces.of(Plane)
def _give_forces(space, window, c, force, i, count):
    zero = broadcast(0.0)
    give(force, i, 0, count, four(window, _T, c), four(window, _T + 1, c), zero, zero)
    give(force, i, WIDTH, count, four(window, _D, c), four(window, _D + 1, c), zero, zero)
