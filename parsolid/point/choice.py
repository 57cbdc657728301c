"""Which law of a material point belongs to which parameters."""

from parsolid.materials.elastic_plastic import ElasticPlastic
from parsolid.materials.mooney_rivlin import MooneyRivlin
from parsolid.materials.prony import Prony
from parsolid.point.laws import MaxwellPoint, PointLaw
from parsolid.point.plastic import PlasticPoint
from parsolid.point.viscoelastic import PronyPoint

POINT_LAWS = {MooneyRivlin: MaxwellPoint, ElasticPlastic: PlasticPoint, Prony: PronyPoint}


def point_law(parameters, **conditions) -> PointLaw:
    """The law of a material point with the given parameters; conditions are keywords of its class."""
    return POINT_LAWS[type(parameters)](parameters, **conditions)
