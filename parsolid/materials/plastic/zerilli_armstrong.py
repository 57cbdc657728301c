"""Flow stress of Zerilli & Armstrong for face-centred cubic metals (J. Appl. Phys. 61 (1987) 1816)."""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp, log
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import flow_stress


@law("flow-stress", "zerilli-armstrong")
class ZerilliArmstrong(NamedTuple):
    """sigma_y = sigma_a + B0 sqrt(ep) exp(-a0 T + a1 T ln rate), the rate in 1/s.

    athermal_stress sigma_a (grain size included), hardening B0 [Pa], softening a0 [1/K], rate_sensitivity a1 [1/K].
    """

    athermal_stress: Annotated[float, Parameter("Pa", "sigma_a, grain size included", above=0.0)]
    hardening: Annotated[float, Parameter("Pa", "B0", at_least=0.0)]
    softening: Annotated[float, Parameter("1/K", "a0", at_least=0.0)]
    rate_sensitivity: Annotated[float, Parameter("1/K", "a1", at_least=0.0)]


@flow_stress.of(ZerilliArmstrong)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    activation = temperature * (model.rate_sensitivity * log(rate) - model.softening)
    solid = model.athermal_stress + model.hardening * plastic_strain**0.5 * exp(activation)
    return solid if temperature < melting_temperature else 0.0
