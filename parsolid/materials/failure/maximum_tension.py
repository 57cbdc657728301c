"""Failure in tension: spall by the largest principal stress, or by the mean stress."""

from typing import Annotated, NamedTuple

from parsolid.materials.declaration import Parameter, law
from parsolid.materials.failure.functions import damage_after
from parsolid.tensors import largest_eigenvalue


@law("failure", "maximum-tension")
class MaximumTension(NamedTuple):
    """Fails where the largest principal stress reaches the strength; damage: the largest that there was, over it."""

    strength: Annotated[float, Parameter("Pa", "largest principal stress", above=0.0)]


@law("failure", "mean-tension")
class MeanTension(NamedTuple):
    """Fails where the mean stress, -P, reaches the strength; damage: the largest that there was, over it."""

    strength: Annotated[float, Parameter("Pa", "mean stress", above=0.0)]


@damage_after.of(MaximumTension)
def _by_principal_stress(criterion, damage, strength, loading):
    principal = largest_eigenvalue(loading.deviator) - loading.pressure
    return max(damage, principal / (strength * criterion.strength))


@damage_after.of(MeanTension)
def _by_mean_stress(criterion, damage, strength, loading):
    return max(damage, -loading.pressure / (strength * criterion.strength))
