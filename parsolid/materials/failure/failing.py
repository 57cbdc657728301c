"""Failure within a step of a particle kernel: what failed matter bears, and what is released where matter fails.

Failed matter has no deviator, and a pressure only where it is compressed: in tension a void opens at no pressure, and
its volume has to close before pressure comes back. The internal energy is continuous at failure: what was stored
elastically is heat from then on. `whole` is positive where matter has not failed, None where its law knows no failure,
and then nothing in here costs anything; `present` is positive where matter was not deleted, None where none is.
"""

import math
from typing import NamedTuple

from decomposition.deferred import register_jitable
from parsolid.materials.failure import lanes_laws  # noqa: F401  (overloads)
from parsolid.materials.failure.failure import Criteria, damage_after
from parsolid.materials.plastic.plasticity import isentropic_bulk_modulus
from parsolid.materials.plastic.specific_heat import temperature_rise
from parsolid.numerics.dispatch import generic
from parsolid.numerics.elementary import choose
from parsolid.numerics.lanes import load, store_first
from parsolid.numerics.tensors import GeneralPlane, GeneralSpace, contract


class Elasticity(NamedTuple):
    """Jacobian, shear modulus [Pa] and rho0 C_v [J/(m^3 K)] at the end of a step."""

    J: float
    shear_modulus: float
    capacity: float


@generic
def found_before(failure, state, i):
    """`whole` and `present` of particles i..i+3 before a step."""


@found_before.of(None)
def _never_fails(failure, state, i):
    return None, None


@found_before.otherwise
def _may_have_failed(failure, state, i):
    return 1.0 - load(state.damage, 0, i), _present(state.deleted_mass, i)


@generic
def _present(deleted_mass, i):
    """Positive where nothing was deleted."""


@_present.of(None)
def _all_present(deleted_mass, i):
    return None


@_present.otherwise
def _not_deleted(deleted_mass, i):
    return choose(load(deleted_mass, 0, i), -1.0, 1.0)


@generic
def moving(present, rate):
    """The velocity gradient, zero of what was deleted."""


@moving.of(None)
def _all_move(present, rate):
    return rate


@moving.otherwise
def _some_move(present, rate):
    return max(present, 0.0) * rate


@generic
def counted(present, valid):
    """Positive where a particle counts."""


@counted.of(None)
def _all_count(present, valid):
    return valid


@counted.otherwise
def _some_count(present, valid):
    return min(present, valid)


@generic
def borne(whole, pressure):
    """The pressure [Pa] that matter bears."""


@borne.of(None)
def _any_pressure(whole, pressure):
    return pressure


@borne.otherwise
def _no_tension(whole, pressure):
    return choose(whole, pressure, max(pressure, 0.0))


@generic
def resisted(whole, pressure, viscous):
    """The viscous pressure [Pa]: none while a void closes."""


@resisted.of(None)
def _always_resisted(whole, pressure, viscous):
    return viscous


@resisted.otherwise
def _resisted_under_pressure(whole, pressure, viscous):
    return choose(whole, viscous, choose(pressure, viscous, 0.0))


@generic
def flowing(whole, s, increment, work):
    """Deviator, plastic increment and work of a step: none of failed matter."""


@flowing.of(None)
def _all_flows(whole, s, increment, work):
    return s, increment, work


@flowing.otherwise
def _whole_flows(whole, s, increment, work):
    return choose(whole, 1.0, 0.0) * s, choose(whole, increment, 0.0), choose(whole, work, 0.0)


@generic
def settled(whole, closed, opened, cold, gamma, part):
    """Energy, temperature and pressure after a step: those of a pressure A + gamma E, or of an open void.

    closed: 1 + part times energy and temperature; opened: those of no pressure at the end of the step.
    """


@settled.of(None)
def _closed(whole, closed, opened, cold, gamma, part):
    energy = closed[0] / (1.0 + part)
    return energy, closed[1] / (1.0 + part), cold + gamma * energy


@settled.otherwise
def _closed_or_open(whole, closed, opened, cold, gamma, part):
    energy, temperature = closed[0] / (1.0 + part), closed[1] / (1.0 + part)
    pressure = cold + gamma * energy
    shut = choose(whole, 1.0, pressure)
    return choose(shut, energy, opened[0]), choose(shut, temperature, opened[1]), choose(shut, pressure, 0.0)


@generic
def _worst(criteria, row, state, i, count, strength, loading, damage):
    """The largest damage of a chain of criteria, whose own are advanced; damage: the largest so far."""


@_worst.of(None)
def _no_other(criteria, row, state, i, count, strength, loading, damage):
    return damage


@_worst.of(Criteria)
def _one_more(criteria, row, state, i, count, strength, loading, damage):
    own = damage_after(criteria.first, load(state.criterion_damage, row, i), strength, loading)
    store_first(state.criterion_damage, row, i, own, count)
    return _worst(criteria.others, row + 1, state, i, count, strength, loading, max(damage, own))


@generic
def _strength(factors, i):
    """Factor of the strength of particles i..i+3."""


@_strength.of(None)
def _equal(factors, i):
    return 1.0


@_strength.otherwise
def _scattered(factors, i):
    return load(factors, 0, i)


@register_jitable
def _stored(law, loading, elasticity):
    """Elastic energy [J/m^3] that goes with the deviator, and with tension: J s:s/(4 mu) and J P^2/(2 K)."""
    J, mu, _ = elasticity
    shear = J * contract(loading.deviator, loading.deviator) / (4.0 * mu)
    tension = min(loading.pressure, 0.0)
    # beyond the spinodal the bulk modulus says nothing
    bulk = max(isentropic_bulk_modulus(law.equation_of_state, J, loading.pressure), mu)
    return shear + J * tension * tension / (2.0 * bulk)


@generic
def failing(whole, law, state, i, count, loading, elasticity, energy, change, strain):
    """Deviator, pressure, energy and temperature of particles i..i+3 after a step in which some fail, what is released
    there [J/m^3], and `whole` after it; damage is advanced.

    loading: `Loading`, elasticity: `Elasticity` at the end of the step; change of J and deviatoric strain in it.
    """


@failing.of(None)
def _none_fails(whole, law, state, i, count, loading, elasticity, energy, change, strain):
    return loading.deviator, loading.pressure, energy, loading.temperature, 0.0, None


@failing.otherwise
def _some_fail(whole, law, state, i, count, loading, elasticity, energy, change, strain):
    old = load(state.damage, 0, i)
    strength = _strength(state.strength_factor, i)
    worst = _worst(law.failure.criteria, 0, state, i, count, strength, loading, old)
    damage = choose(whole, min(worst, 1.0), old)
    store_first(state.damage, 0, i, damage, count)
    left = 1.0 - damage
    # the forces of the next step do not know the stress that is lost, so its half of this step's work was not done
    unpaid = 0.5 * (elasticity.J - 0.5 * change) * contract(loading.deviator, strain)
    unpaid = unpaid - 0.5 * min(loading.pressure, 0.0) * change
    unpaid = choose(whole, choose(left, 0.0, unpaid), 0.0)
    released = choose(whole, choose(left, 0.0, max(_stored(law, loading, elasticity) - unpaid, 0.0)), 0.0)
    temperature = loading.temperature + temperature_rise(law, elasticity.capacity, released)
    s = choose(left, 1.0, 0.0) * loading.deviator
    return s, borne(left, loading.pressure), energy - unpaid, temperature, released, left


@generic
def summed(whole, total, valid, value):
    """A sum over valid particles, with those of this step."""


@summed.of(None)
def _unchanged(whole, total, valid, value):
    return total


@summed.otherwise
def _added(whole, total, valid, value):
    return total + choose(valid, value, 0.0)


@generic
def sounding(whole, J):
    """The Jacobian at which waves run: failed matter with voids is no faster than undeformed matter."""


@sounding.of(None)
def _as_it_is(whole, J):
    return J


@sounding.otherwise
def _without_voids(whole, J):
    return choose(whole, J, min(J, 1.0))


@generic
def formless(whole, F, J):
    """F, of failed matter a stretch alike in all directions (in the plane: of it), for it has no shape to remember."""


@formless.of(None)
def _remembered(whole, F, J):
    return F


@formless.otherwise
def _forgotten(whole, F, J):
    return _without_shape(F, whole, J)


@generic
def _without_shape(F, whole, J):
    """The same, by the kind of tensor."""


@_without_shape.of(GeneralPlane)
def _plane_stretch(F, whole, J):
    r = math.sqrt(max(J / F[4], 0.0))
    xx, xy, yx, yy = choose(whole, F[0], r), choose(whole, F[1], 0.0), choose(whole, F[2], 0.0), choose(whole, F[3], r)
    return GeneralPlane(xx, xy, yx, yy, F[4])


@_without_shape.of(GeneralSpace)
def _space_stretch(F, whole, J):
    r = math.exp(math.log(max(J, 1e-300)) / 3.0)
    xx, xy, xz = choose(whole, F[0], r), choose(whole, F[1], 0.0), choose(whole, F[2], 0.0)
    yx, yy, yz = choose(whole, F[3], 0.0), choose(whole, F[4], r), choose(whole, F[5], 0.0)
    zx, zy, zz = choose(whole, F[6], 0.0), choose(whole, F[7], 0.0), choose(whole, F[8], r)
    return GeneralSpace(xx, xy, xz, yx, yy, yz, zx, zy, zz)
