"""How the particles of the material point method are laid out: rates and stresses as records."""

from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import broadcast
from parsolid.numerics.layout import Plane, four_rows, store_rows
from parsolid.numerics.tensors import GeneralPlane, GeneralSpace


@generic
def load_rate(space, rate, i):
    """Velocity gradient l [1/s] of particles i..i+3 from its rows, each padded to 4."""


@load_rate.of(Plane)
def _load_rate_plane(space, rate, i):
    x, y, z = four_rows(rate, i, 0), four_rows(rate, i, 4), four_rows(rate, i, 8)
    return GeneralPlane(x[0], x[1], y[0], y[1], z[2])


@load_rate.otherwise
def _load_rate_space(space, rate, i):
    x, y, z = four_rows(rate, i, 0), four_rows(rate, i, 4), four_rows(rate, i, 8)
    return GeneralSpace(x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2])


@generic
def store_stress(space, stress, i, values, speed):
    """V sigma of particles i..i+3 as records xx yy zz 0 | yz xz xy c + |v|."""


@store_stress.of(Plane)
def _store_stress_plane(space, stress, i, values, speed):
    zero = broadcast(0.0)
    store_rows(stress, i, 0, values[0], values[1], values[2], zero)
    store_rows(stress, i, 4, zero, zero, values[3], speed)


@store_stress.otherwise
def _store_stress_space(space, stress, i, values, speed):
    zero = broadcast(0.0)
    store_rows(stress, i, 0, values[0], values[1], values[2], zero)
    store_rows(stress, i, 4, values[5], values[4], values[3], speed)
