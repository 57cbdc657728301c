"""Which law of a material point belongs to which parameters."""

from parsolid.materials.elastic_plastic import ElasticPlastic
from parsolid.materials.mooney_rivlin import MooneyRivlin
from parsolid.point.laws import MaxwellPoint, PointLaw
from parsolid.point.plastic import PlasticPoint

POINT_LAWS = {MooneyRivlin: MaxwellPoint, ElasticPlastic: PlasticPoint}


def point_law(parameters, **conditions) -> PointLaw:
    """The law of a material point with the given parameters; conditions are keywords of its class."""
    return POINT_LAWS[type(parameters)](parameters, **conditions)
