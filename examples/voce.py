"""A metal that hardens to saturation: the flow stress of Voce (J. Inst. Met. 74 (1948) 537). A user's own law in her
own file.

sigma_y = sigma_0 + (sigma_s - sigma_0) (1 - exp(-ep/ep_0)), rate-independent, 0 where the metal is molten.
"""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import flow_stress


@law("flow-stress", "voce")
class Voce(NamedTuple):
    """sigma_0, sigma_s: yield stress at first and at saturation; ep_0: strain over which it is reached."""

    yield_stress: Annotated[float, Parameter("Pa", "sigma_0", above=0.0)]
    saturation: Annotated[float, Parameter("Pa", "sigma_s", above=0.0)]
    strain: Annotated[float, Parameter("1", "ep_0", above=0.0)]

    def faults(self):
        """What a scene must not state."""
        bound = f"at least yield_stress = {self.yield_stress:g}"
        return [] if self.saturation >= self.yield_stress else [(("saturation",), bound, self.saturation)]


@flow_stress.of(Voce)
def _voce(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    share = 1.0 - exp(-plastic_strain / model.strain)
    solid = model.yield_stress + (model.saturation - model.yield_stress) * share
    return solid if temperature < melting_temperature else 0.0
