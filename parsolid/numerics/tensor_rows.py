"""Tensors of four neighbouring particles as rows of (rows, capacity) arrays.

General ones: 11 12 21 22 33 in the plane, nine in space; symmetric ones: 11 22 33 12, and 11 22 33 12 13 23.
"""

import math

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import lane, load, store_first
from parsolid.numerics.layout import Plane, Space, load_nine, load_six, store_nine
from parsolid.numerics.tensors import GeneralPlane, GeneralSpace, SymmetricPlane


@register_jitable
def _store_four(array, i, values, count):
    store_first(array, 0, i, values[0], count)
    store_first(array, 1, i, values[1], count)
    store_first(array, 2, i, values[2], count)
    store_first(array, 3, i, values[3], count)


@generic
def load_general(space, array, i):
    """A general tensor of particles i..i+3 from the rows of an array."""


@load_general.of(Plane)
def _load_general_plane(space, array, i):
    xx, xy, yx = load(array, 0, i), load(array, 1, i), load(array, 2, i)
    return GeneralPlane(xx, xy, yx, load(array, 3, i), load(array, 4, i))


@load_general.otherwise
def _load_general_space(space, array, i):
    return load_nine(array, 0, i)


@generic
def one_gradient(space, F, p):
    """F of one particle, its nine components."""


@one_gradient.of(Space)
def _one_in_space(space, F, p):
    return GeneralSpace(F[0, p], F[1, p], F[2, p], F[3, p], F[4, p], F[5, p], F[6, p], F[7, p], F[8, p])


@one_gradient.otherwise
def _one_in_plane(space, F, p):
    return GeneralSpace(F[0, p], F[1, p], 0.0, F[2, p], F[3, p], 0.0, 0.0, 0.0, F[4, p])


@generic
def store_general(space, array, i, values, count):
    """A general tensor of the first `count` of particles i..i+3."""


@store_general.of(Plane)
def _store_general_plane(space, array, i, values, count):
    _store_four(array, i, values, count)
    store_first(array, 4, i, values[4], count)


@store_general.otherwise
def _store_general_space(space, array, i, values, count):
    store_nine(array, 0, i, values, count)


@generic
def load_symmetric(space, array, i):
    """A symmetric tensor of particles i..i+3."""


@load_symmetric.of(Plane)
def _load_symmetric_plane(space, array, i):
    return SymmetricPlane(load(array, 0, i), load(array, 1, i), load(array, 2, i), load(array, 3, i))


@load_symmetric.otherwise
def _load_symmetric_space(space, array, i):
    return load_six(array, 0, i)


@generic
def store_symmetric(space, array, i, values, count):
    """A symmetric tensor of the first `count` of particles i..i+3."""


@store_symmetric.of(Plane)
def _store_symmetric_plane(space, array, i, values, count):
    _store_four(array, i, values, count)


@store_symmetric.otherwise
def _store_symmetric_space(space, array, i, values, count):
    _store_four(array, i, values, count)
    store_first(array, 4, i, values[4], count)
    store_first(array, 5, i, values[5], count)


@register_jitable
def largest_lane(values):
    """The greatest of four lanes."""
    first, second = max(lane(values, 0), lane(values, 1)), max(lane(values, 2), lane(values, 3))
    return max(first, second)


@register_jitable
def speed_of(velocity):
    """|v| of vx, vy, vz and one more number."""
    return math.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2])
