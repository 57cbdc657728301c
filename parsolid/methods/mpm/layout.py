"""How the particles of the material point method are laid out: tensors as rows over particles, rates and stresses as records."""

import math

from numba.extending import overload, register_jitable

from parsolid.numerics.dispatch import is_instance
from parsolid.numerics.lanes import broadcast, lane, load, store_first
from parsolid.numerics.layout import Plane, Space, four_rows, load_nine, store_nine, store_rows


def load_general(space, array, i):
    """A general tensor of particles i..i+3 from the rows of an array."""
    raise NotImplementedError


@overload(load_general)
def _load_general_tensor(space, array, i):
    if is_instance(space, Plane):
        return lambda space, array, i: (
            load(array, 0, i),
            load(array, 1, i),
            load(array, 2, i),
            load(array, 3, i),
            load(array, 4, i),
        )
    return lambda space, array, i: load_nine(array, 0, i)


def one_gradient(space, F, p):
    """F of one particle, its nine components."""
    raise NotImplementedError


@overload(one_gradient)
def _choose_one_gradient(space, F, p):
    if is_instance(space, Space):
        return lambda space, F, p: (F[0, p], F[1, p], F[2, p], F[3, p], F[4, p], F[5, p], F[6, p], F[7, p], F[8, p])
    return lambda space, F, p: (F[0, p], F[1, p], 0.0, F[2, p], F[3, p], 0.0, 0.0, 0.0, F[4, p])


def store_general(space, array, i, values, count):
    """A general tensor of the first `count` of particles i..i+3."""
    raise NotImplementedError


@overload(store_general)
def _store_general_tensor(space, array, i, values, count):
    if is_instance(space, Plane):

        def plane(space, array, i, values, count):
            store_first(array, 0, i, values[0], count)
            store_first(array, 1, i, values[1], count)
            store_first(array, 2, i, values[2], count)
            store_first(array, 3, i, values[3], count)
            store_first(array, 4, i, values[4], count)

        return plane
    return lambda space, array, i, values, count: store_nine(array, 0, i, values, count)


def load_symmetric(space, array, i):
    """A symmetric tensor of particles i..i+3."""
    raise NotImplementedError


@overload(load_symmetric)
def _load_symmetric_tensor(space, array, i):
    if is_instance(space, Plane):
        return lambda space, array, i: (load(array, 0, i), load(array, 1, i), load(array, 2, i), load(array, 3, i))
    return lambda space, array, i: (
        load(array, 0, i),
        load(array, 1, i),
        load(array, 2, i),
        load(array, 3, i),
        load(array, 4, i),
        load(array, 5, i),
    )


def store_symmetric(space, array, i, values, count):
    """A symmetric tensor of the first `count` of particles i..i+3."""
    raise NotImplementedError


@overload(store_symmetric)
def _store_symmetric_tensor(space, array, i, values, count):
    def plane(space, array, i, values, count):
        store_first(array, 0, i, values[0], count)
        store_first(array, 1, i, values[1], count)
        store_first(array, 2, i, values[2], count)
        store_first(array, 3, i, values[3], count)

    if is_instance(space, Plane):
        return plane

    def solid(space, array, i, values, count):
        store_first(array, 0, i, values[0], count)
        store_first(array, 1, i, values[1], count)
        store_first(array, 2, i, values[2], count)
        store_first(array, 3, i, values[3], count)
        store_first(array, 4, i, values[4], count)
        store_first(array, 5, i, values[5], count)

    return solid


def load_rate(space, rate, i):
    """Velocity gradient l [1/s] of particles i..i+3 from its rows, each padded to 4."""
    raise NotImplementedError


@overload(load_rate)
def _load_velocity_gradient(space, rate, i):
    if is_instance(space, Plane):

        def plane(space, rate, i):
            x, y, z = four_rows(rate, i, 0), four_rows(rate, i, 4), four_rows(rate, i, 8)
            return x[0], x[1], y[0], y[1], z[2]

        return plane

    def solid(space, rate, i):
        x, y, z = four_rows(rate, i, 0), four_rows(rate, i, 4), four_rows(rate, i, 8)
        return x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]

    return solid


def store_stress(space, stress, i, values, speed):
    """V sigma of particles i..i+3 as records xx yy zz 0 | yz xz xy c + |v|."""
    raise NotImplementedError


@overload(store_stress)
def _store_stress_record(space, stress, i, values, speed):
    if is_instance(space, Plane):

        def plane(space, stress, i, values, speed):
            zero = broadcast(0.0)
            store_rows(stress, i, 0, values[0], values[1], values[2], zero)
            store_rows(stress, i, 4, zero, zero, values[3], speed)

        return plane

    def solid(space, stress, i, values, speed):
        zero = broadcast(0.0)
        store_rows(stress, i, 0, values[0], values[1], values[2], zero)
        store_rows(stress, i, 4, values[5], values[4], values[3], speed)

    return solid


@register_jitable
def largest_lane(values):
    """The greatest of four lanes."""
    return max(max(lane(values, 0), lane(values, 1)), max(lane(values, 2), lane(values, 3)))


@register_jitable
def speed_of(velocity):
    """|v| of vx, vy, vz and one more number."""
    return math.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2])
