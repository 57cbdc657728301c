"""The two passes over pairs at their present places, each the adjoint of the other (Rahaman et al., (3.6)-(3.10),
mended).

With weights k_ab = k_ba, r = x_b - x_a, g_ab = m_a m_b k_ab r (= m_a m_b grad_a W) and B symmetric:
    grad f_a   = sum_b (f_b - f_a) (x) g_ab B_a / (m_a rho_a)
    m_a v'_a   = sum_b [sigma_a B_a/rho_a^2 + sigma_b B_b/rho_b^2 - Pi_ab] g_ab
    div(xi)_a  = rho_a/m_a sum_b [xi_a B_a/rho_a^2 + xi_b B_b/rho_b^2] . g_ab
    m_a e'_a  += 1/2 sum_b Pi_ab (v_a - v_b) . g_ab                                 (viscosity heats both alike)
so that what stresses and fluxes do to velocities is what gradients see of them, to round-off.
"""

from decomposition.compiled import compiled
from parsolid.methods.ulsph.pair_primitives import (
    flux_of,
    flux_terms,
    gradient_terms,
    length_of,
    moment,
    moment_sum,
    numbers,
    pair_weight,
    present,
    steps,
)
from parsolid.methods.ulsph.pair_terms import act, meet, viscous_pressure
from parsolid.methods.ulsph.sums import sum_columns
from parsolid.methods.ulsph.terms import MicroAndHeatFlux
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import broadcast, from_floats, lane, load, without_fourth
from parsolid.numerics.layout import Plane
from parsolid.pairs.lane_tuples import add_lanes, opposite, plus, store_lanes
from parsolid.pairs.lists import images_of, mutual
from parsolid.pairs.primitives import dot, matrix, outer, stress_of, sum_times


@generic(on="carried")
def _summed(space, carried, sums, a, column):
    """What is summed so far of fluxes, or of gradients of numbers; None where nothing flows."""


@_summed.of(None)
def _nothing_summed(space, carried, sums, a, column):
    return None


@generic
def _two_summed(space, sums, a, column):
    """Of both."""


@_two_summed.of(Plane)
def _two_summed_plane(space, sums, a, column):
    return (load(sums, a, column),)


@_two_summed.otherwise
def _two_summed_space(space, sums, a, column):
    return load(sums, a, column), load(sums, a, column + 4)


@_summed.of(MicroAndHeatFlux)
def _both_summed(space, carried, sums, a, column):
    return _two_summed(space, sums, a, column)


@_summed.otherwise
def _one_summed(space, carried, sums, a, column):
    return (load(sums, a, column),)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_rates(space, kernel, lengths, carried, contact, pairs, arrays, sums):
    """Add what a list's pairs have of velocity gradients, moments and divergences of fluxes to `rate_sums`."""
    images, kinematics, record, at = images_of(pairs), arrays.kinematics, arrays.record, sum_columns(space)
    mass, flux = arrays.mass, arrays.flux
    for a in range(pairs.start.shape[0] - 1):
        if pairs.start[a] == pairs.start[a + 1]:
            continue
        here, own = present(space, None, 0, kinematics, a), flux_of(space, carried, None, 0, flux, a)
        even = matrix(space, sums, a, 0) + moment_sum(space, sums, a)
        odd = _summed(space, carried, sums, a, at.flux)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            dv, r = steps(space, present(space, images, k, kinematics, b), here)
            weight = pair_weight(space, kernel, lengths, a, b, dot(space, r, r))
            if not weight > 0.0:
                continue
            if not meet(space, contact, images, k, record, a, b, dv, r):
                continue
            g = (mass[0, a] * mass[0, b] * weight) * r
            rates = outer(space, dv, g) + moment(space, r, g)
            fluxes = flux_terms(space, own, flux_of(space, carried, images, k, flux, b), g)
            even, odd = plus(even, rates), plus(odd, fluxes)
            if mutual(pairs):
                add_lanes(sums, b, 0, rates)
                add_lanes(sums, b, at.flux, opposite(fluxes))
        store_lanes(sums, a, 0, even)
        store_lanes(sums, a, at.flux, odd)


@generic
def _forces(space, stress, viscous, heat):
    """F, V and in space Q of the first particle."""


@_forces.of(Plane)
def _forces_plane(space, stress, viscous, heat):
    F = stress + viscous
    return (from_floats(lane(F, 0), lane(F, 1), lane(viscous, 0), lane(viscous, 1)),)


@_forces.otherwise
def _forces_space(space, stress, viscous, heat):
    return without_fourth(stress + viscous) + from_floats(0.0, 0.0, 0.0, heat), viscous


@generic
def _force_sums(space, sums, a):
    """What is summed so far of forces."""


@_force_sums.of(Plane)
def _force_sums_plane(space, sums, a):
    return (load(sums, a, 0),)


@_force_sums.otherwise
def _force_sums_space(space, sums, a):
    return load(sums, a, 0), load(sums, a, 4)


@generic
def _opposed(space, forces):
    """What the other particle has of `_forces`: its heat is the same."""


@_opposed.of(Plane)
def _opposed_plane(space, forces):
    return (-forces[0],)


@_opposed.otherwise
def _opposed_space(space, forces):
    return from_floats(-1.0, -1.0, -1.0, 1.0) * forces[0], -forces[1]


@generic(on="warming")
def _heat_sum(space, warming, sums, a):
    """What is summed so far of Q in columns of its own, None where it has none."""


@_heat_sum.of(None)
def _no_heat_sum(space, warming, sums, a):
    return None


@_heat_sum.otherwise
def _some_heat_sum(space, warming, sums, a):
    return _own_columns(space, load(sums, a, sums.shape[1] - 4))


@generic(on="warming")
def _heat(space, warming, heat):
    """Q for columns of its own."""


@_heat.of(None)
def _no_heat(space, warming, heat):
    return None


@_heat.otherwise
def _some_heat(space, warming, heat):
    return _own_columns(space, from_floats(heat, 0.0, 0.0, 0.0))


@generic
def _own_columns(space, lanes):
    """In the plane alone, Q has columns of its own."""


@_own_columns.of(Plane)
def _own_in_plane(space, lanes):
    return (lanes,)


@_own_columns.otherwise
def _none_in_space(space, lanes):
    return None


@compiled(fastmath={"contract"}, error_model="numpy")
def add_forces(space, kernel, lengths, carried, contact, viscosity, warming, pairs, arrays, sums):
    """Add what a list's pairs have of forces, viscous heat and gradients of numbers to `force_sums`."""
    images, kinematics, record, at = images_of(pairs), arrays.kinematics, arrays.record, sum_columns(space)
    last = sums.shape[1] - 4
    for a in range(pairs.start.shape[0] - 1):
        if pairs.start[a] == pairs.start[a + 1]:
            continue
        here, stress = present(space, None, 0, kinematics, a), stress_of(space, None, 0, record, a, 0)
        own, total = numbers(space, kinematics, record, a), _force_sums(space, sums, a)
        even, heats = _summed(space, carried, sums, a, at.gradient), _heat_sum(space, warming, sums, a)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            dv, r = steps(space, present(space, images, k, kinematics, b), here)
            square = dot(space, r, r)
            weight = pair_weight(space, kernel, lengths, a, b, square)
            if not weight > 0.0:
                continue
            product = arrays.mass[0, a] * arrays.mass[0, b] * weight
            g, there = product * r, numbers(space, kinematics, record, b)
            Pi = viscous_pressure(space, viscosity, length_of(lengths, a, b), 0.5 * (own + there), dv, r, square)
            elastic = broadcast(0.0)
            if act(space, contact, images, k, record, a, b, r):
                elastic = sum_times(space, stress, stress_of(space, images, k, record, b, 0), g)
            heat = -0.5 * Pi * product * dot(space, dv, r)
            forces = _forces(space, elastic, broadcast(-Pi) * g, heat)
            gradients = gradient_terms(space, carried, there - own, g)
            total, even, heats = plus(total, forces), plus(even, gradients), plus(heats, _heat(space, warming, heat))
            if mutual(pairs):
                add_lanes(sums, b, 0, _opposed(space, forces))
                add_lanes(sums, b, at.gradient, gradients)
                add_lanes(sums, b, last, _heat(space, warming, heat))
        store_lanes(sums, a, 0, total)
        store_lanes(sums, a, at.gradient, even)
        store_lanes(sums, a, last, heats)
