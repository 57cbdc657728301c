"""What a pair of particles has at its present places: distance, weight, fluxes, contact; by dimension and by term."""

import math

from parsolid.methods.ulsph.terms import (
    HeatFlux,
    ManyLengths,
    MicroAndHeatFlux,
    MicroFlux,
    OneLength,
)
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import broadcast, from_floats, fused, lane, load, swizzle, without_fourth
from parsolid.numerics.layout import Plane
from parsolid.pairs.lists import PLANE_IMAGE, SPACE_IMAGE
from parsolid.pairs.smoothing.gradient import gradient_factor

_swap = swizzle(2, 3, 0, 1)
_twice = swizzle(0, 1, 0, 1)
_both = swizzle(1, 1, 2, 2)
_second = swizzle(1, 1, 1, 1)
_third = swizzle(2, 2, 2, 2)
_xyx, _xyy = swizzle(0, 1, 0, 0), swizzle(0, 1, 1, 1)
_shifted = swizzle(1, 2, 0, 3)


# --- places and motion ------------------------------------------------------------------------------------------


@generic
def present(space, images, k, kinematics, b):
    """v and x of a neighbour, or of its image, as `steps` takes them."""


@present.of(Plane)
def _present_plane(space, images, k, kinematics, b):
    motion = load(kinematics, b, 0)
    if images is None:
        return motion
    Q = load(images.table, images.code[k], PLANE_IMAGE.signs)
    R = load(images.table, images.code[k], PLANE_IMAGE.reflection)
    factors = from_floats(lane(Q, 0), lane(Q, 1), lane(R, 0), lane(R, 1))
    return fused(factors, motion, from_floats(0.0, 0.0, lane(R, 2), lane(R, 3)))


@present.otherwise
def _present_space(space, images, k, kinematics, b):
    v, x = load(kinematics, b, 0), load(kinematics, b, 4)
    if images is None:
        return v, x
    code, table = images.code[k], images.table
    place = fused(load(table, code, SPACE_IMAGE.reflection), x, load(table, code, SPACE_IMAGE.shift))
    # the lane beside v is the speed of sound, which an image shares
    return load(table, code, SPACE_IMAGE.signs) * v + from_floats(0.0, 0.0, 0.0, lane(v, 3)), without_fourth(place)


@generic
def steps(space, there, here):
    """Differences of v and x of two particles' `present`."""


@steps.of(Plane)
def _steps_plane(space, there, here):
    step = there - here
    return step, _swap(step)


@steps.otherwise
def _steps_space(space, there, here):
    return there[0] - here[0], there[1] - here[1]


# --- the kernel -------------------------------------------------------------------------------------------------


@generic
def _gradient_factor(space, kernel, q):
    """The kernel's factor, its dimension known when it is compiled."""


@_gradient_factor.of(Plane)
def _factor_plane(space, kernel, q):
    return gradient_factor(kernel, q, 2)


@_gradient_factor.otherwise
def _factor_space(space, kernel, q):
    return gradient_factor(kernel, q, 3)


@generic(on="lengths")
def pair_weight(space, kernel, lengths, a, b, square):
    """k with grad_a W(x_a - x_b) = k r, r = x_b - x_a of the square [m^2]; 0 beyond the support [m^-(d+2)]."""


@pair_weight.of(OneLength)
def _weight_of_one(space, kernel, lengths, a, b, square):
    return -lengths.scale * _gradient_factor(space, kernel, math.sqrt(square) * lengths.inverse)


@generic
def _scale(space, inverse):
    """h^-(d+2)."""


@_scale.of(Plane)
def _scale_plane(space, inverse):
    return (inverse * inverse) * (inverse * inverse)


@_scale.otherwise
def _scale_space(space, inverse):
    return (inverse * inverse) * (inverse * inverse) * inverse


@pair_weight.of(ManyLengths)
def _weight_of_many(space, kernel, lengths, a, b, square):
    inverse = 2.0 / (lengths.lengths[0, a] + lengths.lengths[0, b])
    return -_scale(space, inverse) * _gradient_factor(space, kernel, math.sqrt(square) * inverse)


@generic
def length_of(lengths, a, b):
    """h [m] of a pair."""


@length_of.of(OneLength)
def _one_length(lengths, a, b):
    return lengths.length


@length_of.of(ManyLengths)
def _mean_length(lengths, a, b):
    return 0.5 * (lengths.lengths[0, a] + lengths.lengths[0, b])


@generic
def moment(space, r, g):
    """r (x) g, symmetric, as `rate_sums` holds it."""


@moment.of(Plane)
def _moment_plane(space, r, g):
    return (
        from_floats(lane(r, 0), lane(r, 1), lane(r, 0), 0.0) * from_floats(lane(g, 0), lane(g, 1), lane(g, 1), 0.0),
    )


@moment.otherwise
def _moment_space(space, r, g):
    return r * g, r * _shifted(g)


@generic
def moment_sum(space, sums, a):
    """The moment so far of particle a."""


@moment_sum.of(Plane)
def _moment_sum_plane(space, sums, a):
    return (load(sums, a, 4),)


@moment_sum.otherwise
def _moment_sum_space(space, sums, a):
    return load(sums, a, 12), load(sums, a, 16)


# --- fluxes and gradients of numbers ----------------------------------------------------------------------------


@generic(on="carried")
def flux_of(space, carried, images, k, flux, b):
    """X and Y of a neighbour in lanes, reflected of an image; None where nothing flows."""


@flux_of.of(None)
def _no_flux(space, carried, images, k, flux, b):
    return None


@generic
def _reflected(space, images, k, flux, b, column):
    """One lane value of the fluxes."""


@_reflected.of(Plane)
def _reflected_plane(space, images, k, flux, b, column):
    value = load(flux, b, column)
    if images is None:
        return value
    return _twice(load(images.table, images.code[k], PLANE_IMAGE.reflection)) * value


@_reflected.otherwise
def _reflected_space(space, images, k, flux, b, column):
    value = load(flux, b, column)
    if images is None:
        return value
    return load(images.table, images.code[k], SPACE_IMAGE.reflection) * value


@generic
def _two_fluxes(space, images, k, flux, b):
    """Both."""


@_two_fluxes.of(Plane)
def _two_in_plane(space, images, k, flux, b):
    return (_reflected(space, images, k, flux, b, 0),)


@_two_fluxes.otherwise
def _two_in_space(space, images, k, flux, b):
    return _reflected(space, images, k, flux, b, 0), _reflected(space, images, k, flux, b, 4)


@flux_of.of(MicroAndHeatFlux)
def _both_fluxes(space, carried, images, k, flux, b):
    return _two_fluxes(space, images, k, flux, b)


@flux_of.otherwise
def _one_flux(space, carried, images, k, flux, b):
    return (_reflected(space, images, k, flux, b, 0),)


@generic
def _along(space, g):
    """g beside itself where a lane value holds two vectors."""


@_along.of(Plane)
def _along_plane(space, g):
    return _twice(g)


@_along.otherwise
def _along_space(space, g):
    return g


@generic(on="own")
def flux_terms(space, own, there, g):
    """(X_a + X_b) g, component by component."""


@flux_terms.of(None)
def _no_flux_terms(space, own, there, g):
    return None


@flux_terms.otherwise
def _flux_terms(space, own, there, g):
    along = _along(space, g)
    if len(own) == 1:
        return ((own[0] + there[0]) * along,)
    return (own[0] + there[0]) * along, (own[1] + there[1]) * along


@generic
def numbers(space, kinematics, record, b):
    """rho, v^p, T, c of a particle in lanes."""


@numbers.of(Plane)
def _numbers_plane(space, kinematics, record, b):
    return load(record, b, 4)


@numbers.otherwise
def _numbers_space(space, kinematics, record, b):
    return from_floats(record[b, 3], record[b, 7], record[b, 11], kinematics[b, 3])


@generic(on="carried")
def gradient_terms(space, carried, difference, g):
    """(v^p_b - v^p_a) g and (T_b - T_a) g of the difference of `numbers`; None where nothing flows."""


@gradient_terms.of(None)
def _no_gradients(space, carried, difference, g):
    return None


@generic
def _two_gradients(space, difference, g):
    """Both."""


@_two_gradients.of(Plane)
def _two_gradients_plane(space, difference, g):
    return (_both(difference) * _twice(g),)


@_two_gradients.otherwise
def _two_gradients_space(space, difference, g):
    return _second(difference) * g, _third(difference) * g


@gradient_terms.of(MicroAndHeatFlux)
def _both_gradients(space, carried, difference, g):
    return _two_gradients(space, difference, g)


@generic
def _one_gradient(space, difference, g, which):
    """One, at its place."""


@_one_gradient.of(Plane)
def _one_gradient_plane(space, difference, g, which):
    return (_both(difference) * _twice(g),)


@_one_gradient.otherwise
def _one_gradient_space(space, difference, g, which):
    return (broadcast(lane(difference, which)) * g,)


@gradient_terms.of(MicroFlux)
def _micro_gradient(space, carried, difference, g):
    return _one_gradient(space, difference, g, 1)


@gradient_terms.of(HeatFlux)
def _heat_gradient(space, carried, difference, g):
    return _one_gradient(space, difference, g, 2)
