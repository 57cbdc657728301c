"""Failure in tension: spall by the largest principal stress, or by the mean stress."""

from typing import Annotated, NamedTuple

from parsolid.materials.declaration import Parameter, law
from parsolid.materials.failure.failure import damage_after
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import LANES, from_floats
from parsolid.numerics.tensors import lane_of_symmetric, largest_eigenvalue


@law("failure", "maximum-tension")
class MaximumTension(NamedTuple):
    """Fails where the largest principal stress reaches the strength; damage: the largest that there was, over it."""

    strength: Annotated[float, Parameter("Pa", "largest principal stress", above=0.0)]


@law("failure", "mean-tension")
class MeanTension(NamedTuple):
    """Fails where the mean stress, -P, reaches the strength; damage: the largest that there was, over it."""

    strength: Annotated[float, Parameter("Pa", "mean stress", above=0.0)]


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
