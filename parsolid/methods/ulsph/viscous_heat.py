"""Heat of the artificial viscosity, from the sums of the second pass."""

from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import load
from parsolid.numerics.layout import Plane, four_rows


@generic(on="heating")
def viscous_heat(heating, space, body, i, factor):
    """Heat of the artificial viscosity [J/m^3] of particles i..i+3 in a step; factor: step over volume
    [s/m^3]."""


@viscous_heat.of(None)
def _no_viscous_heat(heating, space, body, i, factor):
    return 0.0


@viscous_heat.otherwise
def _some_viscous_heat(heating, space, body, i, factor):
    return factor * _heat_of(space, body.force_sums, i)


@generic
def _heat_of(space, sums, i):
    """The heat beside the force [W] of particles i..i+3."""


@_heat_of.of(Plane)
def _heat_of_plane(space, sums, i):
    return four_rows(sums, i, sums.shape[1] - 4)[0]


@_heat_of.otherwise
def _heat_of_space(space, sums, i):
    return four_rows(sums, i, 0)[3]


@generic(on="heating")
def centred_heat(heating, space, body, i, step):
    """The heat [J] of particles i..i+3 in a step [s] by the velocities at its end, of which its work is the loss.

    The sums are of those half a step before; each particle takes what its own acceleration has changed.
    """


@centred_heat.of(None)
def _no_centred_heat(heating, space, body, i, step):
    return 0.0


@centred_heat.otherwise
def _some_centred_heat(heating, space, body, i, step):
    half = 0.5 * step / load(body.mass, 0, i)
    return step * (_heat_of(space, body.force_sums, i) - half * _viscous_power(space, body.force_sums, i))


@generic
def _viscous_power(space, sums, i):
    """V . F [N^2] of particles i..i+3."""


@_viscous_power.of(Plane)
def _viscous_power_plane(space, sums, i):
    f = four_rows(sums, i, 0)
    return f[0] * f[2] + f[1] * f[3]


@_viscous_power.otherwise
def _viscous_power_space(space, sums, i):
    f, v = four_rows(sums, i, 0), four_rows(sums, i, 4)
    return f[0] * v[0] + f[1] * v[1] + f[2] * v[2]
