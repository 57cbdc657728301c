"""Rate-independent von Mises plasticity with linear hardening; perfect plasticity with H = 0."""

from typing import Annotated, NamedTuple

from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import flow_stress


@law("flow-stress", "linear-hardening")
class LinearHardening(NamedTuple):
    """sigma_y = yield_stress + hardening ep, both in Pa."""

    yield_stress: Annotated[float, Parameter("Pa", "the yield stress", above=0.0)]
    hardening: Annotated[
        float, Parameter("Pa", "the slope over the equivalent plastic strain", at_least=0.0, default=0.0)
    ]


@flow_stress.of(LinearHardening)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    solid = model.yield_stress + model.hardening * plastic_strain
    return solid if temperature < melting_temperature else 0.0
