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
def centred_heat(heating, space, body, i, step, mean_step):
    """The heat [J] of particles i..i+3, of which the work of the viscous forces in both kicks around their time is the
    loss; mean_step: of the step before and of this step [s].

    The sums q = -V . v are of velocities v half a step before these kicks, d and d' of which change v by d F/2m and by
    d' F/2m: -V . dv of both is h q - h^2 V . F/2m with h = (d + d')/2, also where d is 0. What contact has changed
    between them, w = V . dv, meets the second one alone.
    """


@centred_heat.of(None)
def _no_centred_heat(heating, space, body, i, step, mean_step):
    return 0.0


@centred_heat.otherwise
def _some_centred_heat(heating, space, body, i, step, mean_step):
    half = 0.5 * mean_step / load(body.mass, 0, i)
    power = _heat_of(space, body.force_sums, i) - half * _viscous_power(space, body.force_sums, i)
    return mean_step * power - 0.5 * step * _changed_between(space, body.force_sums, i)


@generic
def _changed_between(space, sums, i):
    """w [W] of particles i..i+3."""


@_changed_between.of(Plane)
def _changed_in_plane(space, sums, i):
    return four_rows(sums, i, sums.shape[1] - 4)[1]


@_changed_between.otherwise
def _changed_in_space(space, sums, i):
    return four_rows(sums, i, 4)[3]


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
