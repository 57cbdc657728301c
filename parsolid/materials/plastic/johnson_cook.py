"""Flow stress of Johnson & Cook (7th Int. Symp. Ballistics, 1983; Eng. Fract. Mech. 21 (1985) 31)."""

from typing import Annotated, NamedTuple

from parsolid.elementary import log, power
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import flow_stress


@law("flow-stress", "johnson-cook")
class JohnsonCook(NamedTuple):
    """sigma_y = (A + B ep^n) (1 + C ln edot*) (1 - T*^m), edot* = rate/reference_rate >= 1, T* in [0, 1] up to melting.

    yield_stress A, hardening B [Pa], exponent n, rate_sensitivity C, thermal_exponent m, reference_rate [1/s],
    reference_temperature [K] where T* = 0. The shear modulus does not scale it.
    """

    needs_melting = True  # type: ignore[misc]
    yield_stress: Annotated[float, Parameter("Pa", "A", above=0.0)]
    hardening: Annotated[float, Parameter("Pa", "B", at_least=0.0)]
    exponent: Annotated[float, Parameter("1", "n", above=0.0)]
    rate_sensitivity: Annotated[float, Parameter("1", "C", at_least=0.0)]
    thermal_exponent: Annotated[float, Parameter("1", "m", above=0.0)]
    reference_rate: Annotated[float, Parameter("1/s", above=0.0, default=1.0)]
    reference_temperature: Annotated[float, Parameter("K", "where T* = 0", above=0.0)]


@flow_stress.of(JohnsonCook)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    hardened = model.yield_stress + model.hardening * power(plastic_strain, model.exponent)
    fast = 1.0 + model.rate_sensitivity * log(max(rate / model.reference_rate, 1.0))
    warm = (temperature - model.reference_temperature) / (melting_temperature - model.reference_temperature)
    solid = hardened * fast * (1.0 - power(max(warm, 0.0), model.thermal_exponent))
    return solid if temperature < melting_temperature else 0.0
