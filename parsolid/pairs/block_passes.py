"""The two passes over lists by blocks where the dissipation is reconstructed, in space (in the plane: `block_plane`);
arrays are as `pairs.passes` says.

Particles pass through a window, a row for each number of theirs, as far as the block at hand reaches: what its pairs
need of them is loaded from there, what they add is gathered there, and goes to the particles with their own block.
"""

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import constant
from parsolid.numerics.lanes import WIDTH, broadcast
from parsolid.numerics.wide_lanes import WIDE, broadcast_wide, fused_wide, load_wide
from parsolid.pairs import block_plane  # noqa: F401  (what it implements)
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
    reach,
    take,
    turned,
)
from parsolid.pairs.passes import add_gradients
from parsolid.pairs.table_passes import add_forces_by_table
from parsolid.pairs.terms import KINEMATICS, dimension_of

_FIELD, _POSITION = KINEMATICS[3].field, KINEMATICS[3].position
# first rows of the window: of v, then of the sums (column by column), or of x, P L (column by column), impedances,
# 1/2 grad v (column by column), T and D
_V, _SUMS = 0, 3
_X, _P, _Z, _G, _T, _D = 3, 6, 15, 17, 26, 29
# rows of the window that the passes have, in the plane and in space
_ROWS = {2: (6, 18), 3: (_SUMS + 9, _D + 3)}


@constant
def _rows_of_gradients(space):
    return _ROWS[dimension_of(space)][0]


@constant
def _rows_of_forces(space):
    return _ROWS[dimension_of(space)][1]


@register_jitable
def _three(window, row, c):
    return at(window, row, c), at(window, row + 1, c), at(window, row + 2, c)


@register_jitable
def _put_vector(window, row, c, array, i, column):
    """A vector of four particles, and what stands in its pad."""
    x, y, z, pad = columns(array, i, column)
    put(window, row, c, x)
    put(window, row + 1, c, y)
    put(window, row + 2, c, z)
    return pad


@register_jitable
def _give(window, row, c, array, i, column, count):
    """Add three rows of the window to vectors of the first `count` of four particles."""
    first, second, third = four(window, row, c), four(window, row + 1, c), four(window, row + 2, c)
    give(array, i, column, count, first, second, third, broadcast(0.0))


# --- gradients ---------------------------------------------------------------------------------------------------


@enter_velocity.otherwise
def _enter(space, window, c, kinematics, i):
    zero = broadcast(0.0)
    _put_vector(window, _V, c, kinematics, i, _FIELD)
    for row in range(_SUMS, _SUMS + 9):
        put(window, row, c, zero)


@register_jitable
def _outer(window, row, c, u, g):
    """Add u g to three rows and return it."""
    x, y, z = u[0] * g, u[1] * g, u[2] * g
    add(window, row, c, x)
    add(window, row + 1, c, y)
    add(window, row + 2, c, z)
    return x, y, z


@register_jitable
def _sum(first, second):
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


@register_jitable
def _add_all(window, row, c, values):
    add(window, row, c, values[0])
    add(window, row + 1, c, values[1])
    add(window, row + 2, c, values[2])


@gradients_of_block.otherwise
def _gradients_of_block(space, pairs, pattern, c):
    window, patterns, zero = pairs.window, pairs.patterns, broadcast_wide(0.0)
    v = at(window, _V, c), at(window, _V + 1, c), at(window, _V + 2, c)
    first, second, third = (zero, zero, zero), (zero, zero, zero), (zero, zero, zero)
    for k in range(patterns.first[pattern], patterns.first[pattern + 1]):
        b, s = c + patterns.rows[k], patterns.shape[k]
        scale = load_wide(patterns.lanes, 2 * WIDE * k)
        u = at(window, _V, b) - v[0], at(window, _V + 1, b) - v[1], at(window, _V + 2, b) - v[2]
        g = patterns.shapes[s, 0], patterns.shapes[s, 1], patterns.shapes[s, 2]
        if g[0] != 0.0:
            first = _sum(first, _outer(window, _SUMS, b, u, scale * g[0]))
        if g[1] != 0.0:
            second = _sum(second, _outer(window, _SUMS + 3, b, u, scale * g[1]))
        if g[2] != 0.0:
            third = _sum(third, _outer(window, _SUMS + 6, b, u, scale * g[2]))
    _add_all(window, _SUMS, c, first)
    _add_all(window, _SUMS + 3, c, second)
    _add_all(window, _SUMS + 6, c, third)


@give_gradients.otherwise
def _give_gradients(space, window, c, sums, i, count):
    for axis in range(3):
        _give(window, _SUMS + 3 * axis, c, sums, i, WIDTH * axis, count)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_gradients_by_blocks(space, pairs, fields, kinematics, sums):
    """`passes.add_gradients`; fields: the vector in the first columns."""
    window, n, origin, filled = pairs.window, pairs.others.start.shape[0] - 1, 0, 0
    for block in range(pairs.block.shape[0]):
        i, reached = WIDE * block, reach(pairs, block)
        origin = turned(pairs, _rows_of_gradients(space), origin, i, filled, reached)
        while filled < reached:
            enter_velocity(space, window, filled - origin, kinematics, filled)
            filled += WIDTH
        if pairs.block[block] >= 0:
            gradients_of_block(space, pairs, pairs.block[block], i - origin)
        for part in range(i, i + WIDE, WIDTH):
            give_gradients(space, window, part - origin, sums, part, n - part)
    add_gradients(space, pairs.others, fields, kinematics, sums)


# --- forces ------------------------------------------------------------------------------------------------------


@enter_all.otherwise
def _enter_all(space, window, c, kinematics, record, i):
    zero = broadcast(0.0)
    _put_vector(window, _V, c, kinematics, i, _FIELD)
    _put_vector(window, _X, c, kinematics, i, _POSITION)
    # impedances stand in the pads of the stress
    put(window, _Z, c, _put_vector(window, _P, c, record, i, 0))
    put(window, _Z + 1, c, _put_vector(window, _P + 3, c, record, i, WIDTH))
    _put_vector(window, _P + 6, c, record, i, 2 * WIDTH)
    for axis in range(3):
        _put_vector(window, _G + 3 * axis, c, record, i, (3 + axis) * WIDTH)
    for row in range(_T, _T + 6):
        put(window, row, c, zero)


@register_jitable
def _add_column(window, row, b, own, factor, result):
    """result + (own + that of b) factor."""
    return (
        fused_wide(own[0] + at(window, row, b), factor, result[0]),
        fused_wide(own[1] + at(window, row + 1, b), factor, result[1]),
        fused_wide(own[2] + at(window, row + 2, b), factor, result[2]),
    )


@register_jitable
def _dot(u, v):
    return fused_wide(u[2], v[2], fused_wide(u[1], v[1], u[0] * v[0]))


@register_jitable
def _take_all(window, row, b, values):
    take(window, row, b, values[0])
    take(window, row + 1, b, values[1])
    take(window, row + 2, b, values[2])


@register_jitable
def _stresses_of_block(pairs, pattern, c):
    window, patterns, zero = pairs.window, pairs.patterns, broadcast_wide(0.0)
    P, Q, R = _three(window, _P, c), _three(window, _P + 3, c), _three(window, _P + 6, c)
    total = zero, zero, zero
    for k in range(patterns.first[pattern], patterns.first[pattern + 1]):
        b, s = c + patterns.rows[k], patterns.shape[k]
        scale = load_wide(patterns.lanes, 2 * WIDE * k)
        g = patterns.shapes[s, 0], patterns.shapes[s, 1], patterns.shapes[s, 2]
        t = zero, zero, zero
        if g[0] != 0.0:
            t = _add_column(window, _P, b, P, scale * g[0], t)
        if g[1] != 0.0:
            t = _add_column(window, _P + 3, b, Q, scale * g[1], t)
        if g[2] != 0.0:
            t = _add_column(window, _P + 6, b, R, scale * g[2], t)
        total = _sum(total, t)
        _take_all(window, _T, b, t)
    _add_all(window, _T, c, total)


@register_jitable
def _dissipation_of_block(pairs, pattern, c):
    """D = k [Z_s u + (Z_p - Z_s)(u . x) x/|x|^2]."""
    window, patterns, zero = pairs.window, pairs.patterns, broadcast_wide(0.0)
    v, x, fast, slow = _three(window, _V, c), _three(window, _X, c), at(window, _Z, c), at(window, _Z + 1, c)
    F, G, H = _three(window, _G, c), _three(window, _G + 3, c), _three(window, _G + 6, c)
    total = zero, zero, zero
    for k in range(patterns.first[pattern], patterns.first[pattern + 1]):
        b, s = c + patterns.rows[k], patterns.shape[k]
        step = patterns.shapes[s, 4], patterns.shapes[s, 5], patterns.shapes[s, 6]
        u = at(window, _V, b) - v[0], at(window, _V + 1, b) - v[1], at(window, _V + 2, b) - v[2]
        if step[0] != 0.0:
            u = _add_column(window, _G, b, F, step[0], u)
        if step[1] != 0.0:
            u = _add_column(window, _G + 3, b, G, step[1], u)
        if step[2] != 0.0:
            u = _add_column(window, _G + 6, b, H, step[2], u)
        y = at(window, _X, b) - x[0], at(window, _X + 1, b) - x[1], at(window, _X + 2, b) - x[2]
        shear, jump = slow + at(window, _Z + 1, b), load_wide(patterns.lanes, 2 * WIDE * k + WIDE)
        square = max(_dot(y, y), NO_DISTANCE)
        normal = jump * ((fast + at(window, _Z, b)) - shear) * _dot(u, y) / square
        shear = jump * shear
        d = (
            fused_wide(shear, u[0], normal * y[0]),
            fused_wide(shear, u[1], normal * y[1]),
            fused_wide(shear, u[2], normal * y[2]),
        )
        total = _sum(total, d)
        _take_all(window, _D, b, d)
    _add_all(window, _D, c, total)


@forces_of_block.otherwise
def _forces_of_block(space, pairs, pattern, c):
    _stresses_of_block(pairs, pattern, c)
    _dissipation_of_block(pairs, pattern, c)


@give_forces.otherwise
def _give_forces(space, window, c, force, i, count):
    _give(window, _T, c, force, i, 0, count)
    _give(window, _D, c, force, i, WIDTH, count)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_forces_by_blocks(space, pairs, terms, kinematics, record, force):
    """`passes.add_forces`; terms: `MeanRiemann` with reconstruction."""
    window, n, origin, filled = pairs.window, pairs.others.start.shape[0] - 1, 0, 0
    for block in range(pairs.block.shape[0]):
        i, reached = WIDE * block, reach(pairs, block)
        origin = turned(pairs, _rows_of_forces(space), origin, i, filled, reached)
        while filled < reached:
            enter_all(space, window, filled - origin, kinematics, record, filled)
            filled += WIDTH
        if pairs.block[block] >= 0:
            forces_of_block(space, pairs, pairs.block[block], i - origin)
        for part in range(i, i + WIDE, WIDTH):
            give_forces(space, window, part - origin, force, part, n - part)
    add_forces_by_table(space, pairs.others, terms, kinematics, record, force)
