"""A rubber that stiffens: the law of Gent (Rubber Chem. Technol. 69 (1996) 59) with a volumetric part. A user's own law
in her own file.

W = -mu/2 J_m ln(1 - (F:F - 3)/J_m) - mu ln J + lambda/2 (J - 1)^2
"""

from typing import Annotated, NamedTuple

from parsolid.elementary import log
from parsolid.materials.declaration import Density, Parameter, law
from parsolid.materials.hyperelastic.functions import energy, stress
from parsolid.tensors import combine, contract


@law("hyperelastic", "gent")
class Gent(NamedTuple):
    """mu: shear modulus, J_m: F:F - 3 at which chains are fully stretched, lambda: stiffness of the volume."""

    density: Density
    shear_modulus: Annotated[float, Parameter("Pa", "mu", above=0.0)]
    limit: Annotated[float, Parameter("1", "J_m", above=0.0)]
    volume_modulus: Annotated[float, Parameter("Pa", "lambda", at_least=0.0)]
    branch_moduli: tuple | None
    relaxation_times: tuple | None


@energy.of(Gent)
def _energy(law, F, H, J):
    chains = -0.5 * law.shear_modulus * law.limit * log(1.0 - (contract(F, F) - 3.0) / law.limit)
    return chains - law.shear_modulus * log(J) + 0.5 * law.volume_modulus * (J - 1.0) * (J - 1.0)


# the energy is enough: this formula is faster and exact
@stress.of(Gent)
def _stress(law, F, H, J):
    stiffness = law.shear_modulus / (1.0 - (contract(F, F) - 3.0) / law.limit)
    return combine(stiffness, F, law.volume_modulus * (J - 1.0) - law.shear_modulus / J, H)
