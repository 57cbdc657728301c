"""Failure at an equivalent plastic strain, whatever the stress, the rate and the temperature."""

from typing import Annotated, NamedTuple

from parsolid.materials.declaration import Parameter, law
from parsolid.materials.failure.functions import damage_after


@law("failure", "plastic-strain")
class PlasticStrain(NamedTuple):
    """Fails at an equivalent plastic strain; damage: the present one over it."""

    strain: Annotated[float, Parameter("1", "equivalent plastic strain at failure", above=0.0)]


@damage_after.of(PlasticStrain)
def _by_strain(criterion, damage, strength, loading):
    return max(damage, loading.plastic_strain / (strength * criterion.strain))
