"""Tuples of lanes, as long as several fields or terms need; None is the empty one, of what a scene lacks."""

from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import WIDTH, load, store


def _nothing(array, row, column, values):
    return None


@generic
def plus(first, second):
    """Sums of the lanes of two tuples."""


@plus.of(None)
def _plus_none(first, second):
    return None


@plus.of(1)
def _plus_one(first, second):
    return (first[0] + second[0],)


@plus.otherwise
def _plus_more(first, second):
    return (first[0] + second[0], *plus(first[1:], second[1:]))


@generic(on="values")
def store_lanes(array, row, column, values):
    """array[row, column :] = values."""


store_lanes.of(None)(_nothing)


@store_lanes.of(1)
def _store_one(array, row, column, values):
    store(array, row, column, values[0])


@store_lanes.otherwise
def _store_more(array, row, column, values):
    store(array, row, column, values[0])
    store_lanes(array, row, column + WIDTH, values[1:])


@generic(on="values")
def add_lanes(array, row, column, values):
    """array[row, column :] += values."""


add_lanes.of(None)(_nothing)


@add_lanes.of(1)
def _add_one(array, row, column, values):
    store(array, row, column, load(array, row, column) + values[0])


@add_lanes.otherwise
def _add_more(array, row, column, values):
    store(array, row, column, load(array, row, column) + values[0])
    add_lanes(array, row, column + WIDTH, values[1:])


@generic
def opposite(values):
    """The lanes of a tuple with the other sign."""


@opposite.of(None)
def _opposite_none(values):
    return None


@opposite.of(1)
def _opposite_one(values):
    return (-values[0],)


@opposite.otherwise
def _opposite_more(values):
    return (-values[0], *opposite(values[1:]))
