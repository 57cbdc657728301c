"""Divergences of fluxes and gradients of numbers of four particles, from the sums of the passes."""

from decomposition.deferred import register_jitable
from parsolid.methods.ulsph.terms import COLUMNS, HeatFlux, MicroAndHeatFlux, MicroFlux, flux_places
from parsolid.numerics.dispatch import constant, generic, none_without
from parsolid.numerics.lanes import broadcast
from parsolid.numerics.layout import Plane, four_rows, store_rows
from parsolid.pairs.terms import dimension_of


@constant
def _places(space, carried):
    """Columns of the micro-flux and of the heat flux; constants in kernels."""
    return flux_places(dimension_of(space), carried)


@constant
def sum_columns(space):
    """First columns of the sums; constants in kernels."""
    return COLUMNS[dimension_of(space)]


# --- as components ----------------------------------------------------------------------------------------------


@generic
def _vector(space, array, i, column):
    """Components of a vector in some columns of rows i..i+3."""


@_vector.of(Plane)
def _plane_vector(space, array, i, column):
    # four columns that start where both vectors do
    rows = four_rows(array, i, column - column % 4)
    if column % 4 == 0:
        return rows[0], rows[1]
    return rows[2], rows[3]


@_vector.otherwise
def _space_vector(space, array, i, column):
    rows = four_rows(array, i, column)
    return rows[0], rows[1], rows[2]


@register_jitable
def _sum(vector):
    result = vector[0]
    for k in range(1, len(vector)):
        result = result + vector[k]
    return result


@generic
def _times(space, B, vector, factor):
    """factor B v."""


@_times.of(Plane)
def _plane_times(space, B, vector, factor):
    x, y = vector
    return factor * (B[0] * x + B[3] * y), factor * (B[3] * x + B[1] * y)


@_times.otherwise
def _space_times(space, B, vector, factor):
    x, y, z = vector
    return (
        factor * (B[0] * x + B[3] * y + B[4] * z),
        factor * (B[3] * x + B[1] * y + B[5] * z),
        factor * (B[4] * x + B[5] * y + B[2] * z),
    )


# --- by what flows ----------------------------------------------------------------------------------------------


@generic(on="carried")
def divergences(space, carried, body, i, factor):
    """div xi [Pa] and div q [W/m^3] of particles i..i+3, None of what does not flow; factor: rho/m."""


@divergences.of(None)
def _no_divergences(space, carried, body, i, factor):
    return None, None


@divergences.of(MicroFlux)
def _micro_divergence(space, carried, body, i, factor):
    return factor * _sum(_vector(space, body.rate_sums, i, sum_columns(space).flux)), None


@divergences.of(HeatFlux)
def _heat_divergence(space, carried, body, i, factor):
    column = sum_columns(space).flux + _places(space, carried)[1]
    return None, factor * _sum(_vector(space, body.rate_sums, i, column))


@divergences.of(MicroAndHeatFlux)
def _both_divergences(space, carried, body, i, factor):
    micro, heat = sum_columns(space).flux, sum_columns(space).flux + _places(space, carried)[1]
    return (
        factor * _sum(_vector(space, body.rate_sums, i, micro)),
        factor * _sum(_vector(space, body.rate_sums, i, heat)),
    )


@generic(on="carried")
def gradients(space, carried, body, i, B, factor):
    """grad v^p and grad T of particles i..i+3, None of what does not flow; factor: 1/(m rho)."""


@gradients.of(None)
def _no_gradients(space, carried, body, i, B, factor):
    return None, None


@gradients.of(MicroFlux)
def _micro_gradient(space, carried, body, i, B, factor):
    return _times(space, B, _vector(space, body.force_sums, i, sum_columns(space).gradient), factor), None


@gradients.of(HeatFlux)
def _heat_gradient(space, carried, body, i, B, factor):
    column = sum_columns(space).gradient + _places(space, carried)[1]
    return None, _times(space, B, _vector(space, body.force_sums, i, column), factor)


@gradients.of(MicroAndHeatFlux)
def _both_gradients(space, carried, body, i, B, factor):
    column = sum_columns(space).gradient + _places(space, carried)[1]
    return (
        _times(space, B, _vector(space, body.force_sums, i, sum_columns(space).gradient), factor),
        _times(space, B, _vector(space, body.force_sums, i, column), factor),
    )


# --- what the neighbours read -----------------------------------------------------------------------------------


@none_without("first", returns="second")
def _plus(first, second):
    return _added(second, first)


@none_without("second", returns="first")
def _added(second, first):
    if len(first) == 2:
        return first[0] + second[0], first[1] + second[1]
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


@none_without("vector")
def _record(vector, space, B, factor):
    return _times(space, B, vector, factor)


@generic(on="vector")
def _pair_of(space, vector):
    """A vector's components in the plane, zeros where it is None."""


@_pair_of.of(None)
def _zeros(space, vector):
    return broadcast(0.0), broadcast(0.0)


@_pair_of.otherwise
def _components(space, vector):
    return broadcast(vector[0]), broadcast(vector[1])


@generic
def _store(space, carried, flux, i, X, Y):
    """X and Y of particles i..i+3."""


@_store.of(Plane)
def _store_plane(space, carried, flux, i, X, Y):
    first, second = _pair_of(space, X), _pair_of(space, Y)
    store_rows(flux, i, 0, first[0], first[1], second[0], second[1])


@none_without("vector")
def _store_three(vector, flux, i, column):
    store_rows(flux, i, column, vector[0], vector[1], vector[2], broadcast(0.0))
    return vector


@_store.otherwise
def _store_space(space, carried, flux, i, X, Y):
    _store_three(X, flux, i, 0)
    _store_three(Y, flux, i, _second_place(Y, space, carried))


@none_without("vector")
def _second_place(vector, space, carried):
    return _places(space, carried)[1]


@generic(on="carried")
def store_fluxes(space, carried, flux, i, B, factor, energetic, dissipative, heat_flux):
    """X = (xi_en + xi_dis) B factor and Y = q B factor, factor = 1/rho^2; up to three records beyond are written."""


@store_fluxes.of(None)
def _store_no_fluxes(space, carried, flux, i, B, factor, energetic, dissipative, heat_flux):
    return None


@store_fluxes.otherwise
def _store_fluxes(space, carried, flux, i, B, factor, energetic, dissipative, heat_flux):
    micro = _record(_plus(energetic, dissipative), space, B, factor)
    _store(space, carried, flux, i, micro, _record(heat_flux, space, B, factor))
