"""Criteria of failure on four particles at once, for methods that have not moved to `functions`."""

import math

from parsolid.materials.failure.failure import damage_after
from parsolid.materials.failure.johnson_cook_damage import JohnsonCookDamage
from parsolid.materials.failure.maximum_tension import MaximumTension, MeanTension
from parsolid.materials.failure.plastic_strain import PlasticStrain
from parsolid.numerics.dispatch import generic
from parsolid.numerics.elementary import choose
from parsolid.numerics.lanes import LANES, from_floats
from parsolid.numerics.tensors import contract, lane_of_symmetric, largest_eigenvalue

_LEAST_STRESS = 1.0


@generic
def strain_to_fracture(criterion, triaxiality, rate, temperature, melting_temperature):
    """ef at a ratio of mean stress (tension positive) over von Mises stress, an equivalent plastic strain rate [1/s]
    and a temperature [K].
    """


@strain_to_fracture.of(JohnsonCookDamage)
def _johnson_cook(criterion, triaxiality, rate, temperature, melting_temperature):
    stressed = criterion.d1 + criterion.d2 * math.exp(min(criterion.d3 * triaxiality, 100.0))
    fast = 1.0 + criterion.d4 * math.log(max(rate / criterion.reference_rate, 1.0))
    warm = (temperature - criterion.reference_temperature) / (melting_temperature - criterion.reference_temperature)
    hot = 1.0 + criterion.d5 * min(max(warm, 0.0), 1.0)
    # two negative factors are no strength
    return max(max(stressed, 0.0) * max(fast, 0.0) * max(hot, 0.0), criterion.least_strain)


@damage_after.of(JohnsonCookDamage)
def _accumulated(criterion, damage, strength, loading):
    mises = math.sqrt(1.5 * contract(loading.deviator, loading.deviator))
    triaxiality = -loading.pressure / max(mises, _LEAST_STRESS)
    limit = strain_to_fracture(criterion, triaxiality, loading.rate, loading.temperature, loading.melting_temperature)
    return damage + choose(loading.increment, loading.increment / (strength * limit), 0.0)


@generic(on="pressure")
def _largest_principal(deviator, pressure):
    """The largest principal stress [Pa]."""


@_largest_principal.of(LANES)
def _of_four(deviator, pressure):
    a, b = largest_eigenvalue(lane_of_symmetric(deviator, 0)), largest_eigenvalue(lane_of_symmetric(deviator, 1))
    c, d = largest_eigenvalue(lane_of_symmetric(deviator, 2)), largest_eigenvalue(lane_of_symmetric(deviator, 3))
    return from_floats(a, b, c, d) - pressure


@_largest_principal.otherwise
def _of_one(deviator, pressure):
    return largest_eigenvalue(deviator) - pressure


@damage_after.of(MaximumTension)
def _by_principal_stress(criterion, damage, strength, loading):
    return max(damage, _largest_principal(loading.deviator, loading.pressure) / (strength * criterion.strength))


@damage_after.of(MeanTension)
def _by_mean_stress(criterion, damage, strength, loading):
    return max(damage, -loading.pressure / (strength * criterion.strength))


@damage_after.of(PlasticStrain)
def _by_strain(criterion, damage, strength, loading):
    return max(damage, loading.plastic_strain / (strength * criterion.strain))
