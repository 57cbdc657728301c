"""A soft tissue that stiffens: the exponential law of Demiray (J. Biomech. 5 (1972) 309) with a volumetric part. A
user's own law in her own file.

W = mu/(2 b) [exp(b (F:F - 3)) - 1] - mu ln J + lambda/2 (J - 1)^2
"""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp, log
from parsolid.materials.declaration import Density, Parameter, law
from parsolid.materials.hyperelastic.functions import energy, stress
from parsolid.tensors import combine, contract


@law("hyperelastic", "demiray")
class Demiray(NamedTuple):
    """mu: shear modulus, b: how fast the tissue stiffens, lambda: stiffness of the volume."""

    density: Density
    shear_modulus: Annotated[float, Parameter("Pa", "mu", above=0.0)]
    exponent: Annotated[float, Parameter("1", "b", above=0.0)]
    volume_modulus: Annotated[float, Parameter("Pa", "lambda", at_least=0.0)]
    branch_moduli: tuple | None
    relaxation_times: tuple | None


@energy.of(Demiray)
def _energy(law, F, H, J):
    shape = 0.5 * law.shear_modulus / law.exponent * (exp(law.exponent * (contract(F, F) - 3.0)) - 1.0)
    return shape - law.shear_modulus * log(J) + 0.5 * law.volume_modulus * (J - 1.0) * (J - 1.0)


# the energy is enough: this formula is faster and exact
@stress.of(Demiray)
def _stress(law, F, H, J):
    stiffness = law.shear_modulus * exp(law.exponent * (contract(F, F) - 3.0))
    return combine(stiffness, F, law.volume_modulus * (J - 1.0) - law.shear_modulus / J, H)
