"""Particles in space side by side, as many as the processor's registers hold, where formulas are arithmetic alone.

What kernels need that take their width from the type of space: four particles (`numerics.layout`), or `WIDE`.
"""

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import WIDTH, all_positive, broadcast, lane, load, store, total
from parsolid.numerics.layout import (
    Space,
    four_rows,
    load_branch,
    load_correction,
    load_deformation_gradient,
    load_gradient,
    store_branch,
    store_deformation_gradient,
    store_matrix,
    store_rows,
)
from parsolid.numerics.tensors import GeneralSpace, SymmetricSpace
from parsolid.numerics.wide_lanes import (
    WIDE,
    all_positive_wide,
    broadcast_wide,
    first_lanes,
    halves,
    joined,
    load_row_wide,
    store_first_wide,
)


class WideSpace(Space):
    """Three dimensions, `WIDE` particles at a time."""

    __slots__ = ()


WIDE_SPACE = WideSpace()


# --- particles in lanes ------------------------------------------------------------------------------------------


@generic
def at_once(space):
    """How many particles stand side by side."""


@at_once.of(WideSpace)
def _wide(space):
    return WIDE


@at_once.otherwise
def _four(space):
    return WIDTH


@generic
def everywhere(space, value):
    """A number in all lanes; lanes as they are."""


@everywhere.of(WideSpace)
def _everywhere_wide(space, value):
    return broadcast_wide(value)


@everywhere.otherwise
def _everywhere(space, value):
    return broadcast(value)


@generic
def load_row(space, array, row, i):
    """array[row, i], array[row, i + 1] and so on."""


@load_row.of(WideSpace)
def _row_wide(space, array, row, i):
    return load_row_wide(array, row, i)


@load_row.otherwise
def _row(space, array, row, i):
    return load(array, row, i)


@generic
def all_sound(space, J):
    """Whether all lanes are greater than zero."""


@all_sound.of(WideSpace)
def _all_sound_wide(space, J):
    return all_positive_wide(J)


@all_sound.otherwise
def _all_sound(space, J):
    return all_positive(J)


@generic
def sum_of_lanes(space, value):
    """The sum over the lanes."""


@sum_of_lanes.of(WideSpace)
def _sum_wide(space, value):
    low, high = halves(value)
    return total(low + high)


@sum_of_lanes.otherwise
def _sum(space, value):
    return total(value)


@generic
def greatest_lane(space, value):
    """The greatest lane."""


@greatest_lane.of(WideSpace)
def _greatest_wide(space, value):
    low, high = halves(value)
    return _greatest(space, max(low, high))


@greatest_lane.otherwise
@register_jitable
def _greatest(space, value):
    return max(lane(value, 0), lane(value, 1), lane(value, 2), lane(value, 3))


@register_jitable
def only_first(value, count, width):
    """A value with zeros beyond the first `count` lanes of so many."""
    if count < width:
        value = first_lanes(value, count)
    return value


@generic
def clear_rows(space, array, i, count):
    """array[i : i + count] = 0, at most as many rows as particles stand side by side."""


@clear_rows.of(WideSpace)
def _clear_wide(space, array, i, count):
    columns = array.shape[1]
    for first in range(0, count * columns, WIDE):
        # beyond the end of a row the next one begins, and the columns are a multiple of four
        store_first_wide(array, i, first, broadcast_wide(0.0), min(WIDE, count * columns - first))


@clear_rows.otherwise
def _clear(space, array, i, count):
    zero = broadcast(0.0)
    for column in range(0, array.shape[1], WIDTH):
        # one after the other: a loop would become a call
        store(array, i, column, zero)
        if count > 1:
            store(array, i + 1, column, zero)
        if count > 2:
            store(array, i + 2, column, zero)
        if count > 3:
            store(array, i + 3, column, zero)


# --- state, as `numerics.layout` has it --------------------------------------------------------------------------


@register_jitable
def _three(array, row, i):
    return load_row_wide(array, row, i), load_row_wide(array, row + 1, i), load_row_wide(array, row + 2, i)


@register_jitable
def _keep_three(array, row, i, first, second, third, count):
    store_first_wide(array, row, i, first, count)
    store_first_wide(array, row + 1, i, second, count)
    store_first_wide(array, row + 2, i, third, count)


@load_deformation_gradient.of(WideSpace)
@load_correction.of(WideSpace)
def _general(space, rows, i):
    x, y, z = _three(rows, 0, i), _three(rows, 3, i), _three(rows, 6, i)
    return GeneralSpace(x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2])


@store_deformation_gradient.of(WideSpace)
def _keep_gradient(space, rows, i, F, J, count):
    _keep_three(rows, 0, i, F[0], F[1], F[2], count)
    _keep_three(rows, 3, i, F[3], F[4], F[5], count)
    _keep_three(rows, 6, i, F[6], F[7], F[8], count)
    store_first_wide(rows, 9, i, J, count)


@load_branch.of(WideSpace)
def _branch(space, branches, alpha, i):
    x, y = _three(branches, 6 * alpha, i), _three(branches, 6 * alpha + 3, i)
    return SymmetricSpace(x[0], x[1], x[2], y[0], y[1], y[2])


@store_branch.of(WideSpace)
def _keep_branch(space, branches, alpha, i, A, count):
    _keep_three(branches, 6 * alpha, i, A[0], A[1], A[2], count)
    _keep_three(branches, 6 * alpha + 3, i, A[3], A[4], A[5], count)


@register_jitable
def _columns(array, i, column):
    """Three columns of the rows i..i+7."""
    low, high = four_rows(array, i, column), four_rows(array, i + WIDTH, column)
    return joined(low[0], high[0]), joined(low[1], high[1]), joined(low[2], high[2])


@load_gradient.of(WideSpace)
def _gradient(space, gradient, i):
    x, y, z = _columns(gradient, i, 0), _columns(gradient, i, WIDTH), _columns(gradient, i, 2 * WIDTH)
    return GeneralSpace(x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])


@register_jitable
def store_columns_wide(array, i, column, first, second, third, fourth):
    """Lanes over particles into array[i..i+7, column : column + 4]."""
    x, y, z, w = halves(first), halves(second), halves(third), halves(fourth)
    store_rows(array, i, column, x[0], y[0], z[0], w[0])
    store_rows(array, i + WIDTH, column, x[1], y[1], z[1], w[1])


@store_matrix.of(WideSpace)
def _keep_matrix(space, record, i, column, matrix):
    zero = broadcast_wide(0.0)
    store_columns_wide(record, i, column, matrix[0], matrix[3], matrix[6], zero)
    store_columns_wide(record, i, column + WIDTH, matrix[1], matrix[4], matrix[7], zero)
    store_columns_wide(record, i, column + 2 * WIDTH, matrix[2], matrix[5], matrix[8], zero)
