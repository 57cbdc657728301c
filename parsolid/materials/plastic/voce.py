"""Hardening of Voce (J. Inst. Metals 74 (1948) 537) that saturates, with a linear part."""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import flow_stress


@law("flow-stress", "voce")
class Voce(NamedTuple):
    """sigma_y = yield_stress + saturation (1 - exp(-exponent ep)) + hardening ep, stresses in Pa; it knows no rate."""

    yield_stress: Annotated[float, Parameter("Pa", "the yield stress", above=0.0)]
    saturation: Annotated[float, Parameter("Pa", "rise of the yield stress by saturating hardening", at_least=0.0)]
    exponent: Annotated[float, Parameter("1", "rate of saturation over the equivalent plastic strain", above=0.0)]
    hardening: Annotated[
        float,
        Parameter("Pa", "slope of linear hardening over the equivalent plastic strain", at_least=0.0, default=0.0),
    ]


@flow_stress.of(Voce)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    saturated = model.saturation * (1.0 - exp(-model.exponent * plastic_strain))
    solid = model.yield_stress + saturated + model.hardening * plastic_strain
    return solid if temperature < melting_temperature else 0.0
