"""The window through which particles pass in lists by blocks, a row for each number of theirs, as far as the block at
hand reaches: what the passes in the plane and in space have in common."""

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import load, store, transpose
from parsolid.numerics.wide_lanes import WIDE, load_wide, store_wide
from parsolid.pairs.block_lists import STRIDE
from parsolid.pairs.lane_tuples import add_lanes

# the window is put back to its start when a block has gone this far, in rows or so many times what a block reaches
_TURN, _LEAST = 4, 1024
# squared distance [m^2] in place of none, that of lanes without a pair
NO_DISTANCE = 1e-300


@register_jitable
def at(window, row, c):
    """A row of the window at a block."""
    return load_wide(window, row * STRIDE + c)


@register_jitable
def add(window, row, c, value):
    """Add to a row at a block."""
    store_wide(window, row * STRIDE + c, load_wide(window, row * STRIDE + c) + value)


@register_jitable
def take(window, row, c, value):
    """Subtract from a row at a block."""
    store_wide(window, row * STRIDE + c, load_wide(window, row * STRIDE + c) - value)


@register_jitable
def put(window, row, c, value):
    """Set a row at four particles."""
    store(window, row * STRIDE + c, 0, value)


@register_jitable
def four(window, row, c):
    """A row of the window at four particles."""
    return load(window, row * STRIDE + c, 0)


@register_jitable
def columns(array, i, column):
    """Four numbers of four particles, particles in lanes."""
    return transpose(
        load(array, i, column), load(array, i + 1, column), load(array, i + 2, column), load(array, i + 3, column)
    )


@register_jitable
def give(array, i, column, count, first, second, third, fourth):
    """Add four numbers of each of the first `count` of four particles, which stand in lanes."""
    values = transpose(first, second, third, fourth)
    if count > 0:
        add_lanes(array, i, column, (values[0],))
    if count > 1:
        add_lanes(array, i + 1, column, (values[1],))
    if count > 2:
        add_lanes(array, i + 2, column, (values[2],))
    if count > 3:
        add_lanes(array, i + 3, column, (values[3],))


@register_jitable
def reach(pairs, block):
    """The first particle that a block does not reach."""
    return min(WIDE * block + pairs.ahead[0], WIDE * pairs.block.shape[0])


@register_jitable
def turned(pairs, rows, origin, i, filled, reached):
    """The particle at the start of the window; i where the end was near and the window from there on was moved."""
    window, ahead = pairs.window, pairs.ahead[0]
    # the last block's lanes without a pair go on beyond its last particle
    if reached - origin <= min(STRIDE - WIDE, ahead + _TURN * max(ahead, _LEAST)):
        return origin
    for row in range(rows):
        for c in range(filled - i):
            window[row * STRIDE + c] = window[row * STRIDE + c + i - origin]
    return i


# --- what differs between the plane and space ----------------------------------------------------------------------


@generic
def enter_velocity(space, window, c, kinematics, i):
    """Put what the pass takes of four particles into the window."""


@generic
def gradients_of_block(space, pairs, pattern, c):
    """Sums of the pairs of a block."""


@generic
def give_gradients(space, window, c, sums, i, count):
    """Add what the first `count` of four particles have got in the window to theirs."""


@generic
def enter_all(space, window, c, kinematics, record, i):
    """Put what the pass takes of four particles into the window."""


@generic
def forces_of_block(space, pairs, pattern, c):
    """Forces of the pairs of a block."""


@generic
def give_forces(space, window, c, force, i, count):
    """Add what the first `count` of four particles have got in the window to theirs."""
