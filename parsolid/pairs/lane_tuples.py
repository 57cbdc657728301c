"""Tuples of lanes, as long as several fields or terms need; None is the empty one, of what a scene lacks."""

from numba.core import types
from numba.extending import overload

from parsolid.numerics.lanes import WIDTH, load, store


def plus(first, second):
    """Sums of the lanes of two tuples."""
    raise NotImplementedError


@overload(plus, strict=False)
def _plus(first, second):
    if isinstance(first, types.NoneType):
        return lambda first, second: None
    if len(first) == 1:
        return lambda first, second: (first[0] + second[0],)
    return lambda first, second: (first[0] + second[0], *plus(first[1:], second[1:]))


def store_lanes(array, row, column, values):
    """array[row, column :] = values."""
    raise NotImplementedError


@overload(store_lanes, strict=False)
def _store_lanes(array, row, column, values):
    if isinstance(values, types.NoneType):
        return lambda array, row, column, values: None
    if len(values) == 1:
        return lambda array, row, column, values: store(array, row, column, values[0])

    def more(array, row, column, values):
        store(array, row, column, values[0])
        store_lanes(array, row, column + WIDTH, values[1:])

    return more


def add_lanes(array, row, column, values):
    """array[row, column :] += values."""
    raise NotImplementedError


@overload(add_lanes, strict=False)
def _add_lanes(array, row, column, values):
    if isinstance(values, types.NoneType):
        return lambda array, row, column, values: None
    if len(values) == 1:
        return lambda array, row, column, values: store(array, row, column, load(array, row, column) + values[0])

    def more(array, row, column, values):
        store(array, row, column, load(array, row, column) + values[0])
        add_lanes(array, row, column + WIDTH, values[1:])

    return more


def opposite(values):
    """The lanes of a tuple with the other sign."""
    raise NotImplementedError


@overload(opposite, strict=False)
def _opposite(values):
    if isinstance(values, types.NoneType):
        return lambda values: None
    if len(values) == 1:
        return lambda values: (-values[0],)
    return lambda values: (-values[0], *opposite(values[1:]))
