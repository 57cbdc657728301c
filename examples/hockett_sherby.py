"""A metal that hardens to saturation: the flow stress of Hockett & Sherby (J. Mech. Phys. Solids 23 (1975) 87). A
user's own law in her own file.

sigma_y = sigma_s - (sigma_s - sigma_0) exp(-(ep/ep_0)^n), rate-independent, 0 where the metal is molten.
"""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp, power
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import flow_stress


@law("flow-stress", "hockett-sherby")
class HockettSherby(NamedTuple):
    """sigma_0, sigma_s: yield stress at first and at saturation; ep_0: strain over which it is reached."""

    yield_stress: Annotated[float, Parameter("Pa", "sigma_0", above=0.0)]
    saturation: Annotated[float, Parameter("Pa", "sigma_s", above=0.0)]
    strain: Annotated[float, Parameter("1", "ep_0", above=0.0)]
    exponent: Annotated[float, Parameter("1", "n", above=0.0)]

    def faults(self):
        """What a scene must not state."""
        bound = f"at least yield_stress = {self.yield_stress:g}"
        return [] if self.saturation >= self.yield_stress else [(("saturation",), bound, self.saturation)]


@flow_stress.of(HockettSherby)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    left = exp(-power(plastic_strain / model.strain, model.exponent))
    solid = model.saturation - (model.saturation - model.yield_stress) * left
    return solid if temperature < melting_temperature else 0.0
