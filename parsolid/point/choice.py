"""Which law of a material point belongs to which parameters."""

from typing import Any

from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.micro_inertia import MicroInertia
from parsolid.materials.viscoelastic.prony import Prony
from parsolid.point.laws import MaxwellPoint, PointLaw
from parsolid.point.micro_inertia import MicroInertiaPoint
from parsolid.point.plastic import PlasticPoint
from parsolid.point.viscoelastic import PronyPoint

POINT_LAWS = {
    ElasticPlastic: PlasticPoint,
    MicroInertia: MicroInertiaPoint,
    Prony: PronyPoint,
}


def point_law(parameters: Any, **conditions: Any) -> PointLaw:
    """The law of a material point with the given parameters, hyperelastic if of no other kind; conditions are keywords
    of its class.
    """
    chosen = next((POINT_LAWS[kind] for kind in type(parameters).__mro__ if kind in POINT_LAWS), MaxwellPoint)
    return chosen(parameters, **conditions)
