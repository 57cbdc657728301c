"""Heat of the artificial viscosity, from the sums of the second pass."""

from parsolid.numerics.dispatch import generic
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
