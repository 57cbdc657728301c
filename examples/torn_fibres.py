"""A tissue whose fibres tear: a user's own law with a direction and a state variable.

W = mu/2 (F:F - 3) - mu ln J + lambda/2 (J - 1)^2 + (1 - d) w,   w = k/2 <a.C a - 1>^2 of fibres along a,
d = 1 - exp(-worst/c) from the largest w so far. On the way to it c - (worst + c) exp(-worst/c) is dissipated.
"""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp, log
from parsolid.kernels import inlined
from parsolid.materials.declaration import Density, Direction, Parameter, StateVariable, law
from parsolid.materials.hyperelastic.functions import dissipated_energy, energy, next_state
from parsolid.tensors import contract


@law("hyperelastic", "torn-fibres")
class TornFibres(NamedTuple):
    """mu, lambda: of what is between the fibres; k: stiffness of the fibres; c: the energy that tears them."""

    density: Density
    shear_modulus: Annotated[float, Parameter("Pa", "mu", above=0.0)]
    volume_modulus: Annotated[float, Parameter("Pa", "lambda", at_least=0.0)]
    fibre_modulus: Annotated[float, Parameter("Pa", "k", at_least=0.0)]
    toughness: Annotated[float, Parameter("J/m^3", "c", above=0.0)]
    fibre: Annotated[tuple, Direction("of the fibres")]
    worst: Annotated[float, StateVariable("J/m^3", "the largest energy of the fibres so far")]
    branch_moduli: tuple | None
    relaxation_times: tuple | None


@inlined
def of_fibres(law, F):
    a, b, c = law.fibre
    x, y, z = F[0] * a + F[1] * b + F[2] * c, F[3] * a + F[4] * b + F[5] * c, F[6] * a + F[7] * b + F[8] * c
    stretch = max(x * x + y * y + z * z - 1.0, 0.0)
    return 0.5 * law.fibre_modulus * stretch * stretch


@energy.of(TornFibres)
def _energy(law, F, H, J):
    matrix = 0.5 * law.shear_modulus * (contract(F, F) - 3.0) - law.shear_modulus * log(J)
    whole = exp(-law.worst / law.toughness)
    return matrix + 0.5 * law.volume_modulus * (J - 1.0) * (J - 1.0) + whole * of_fibres(law, F)


@next_state.of(TornFibres)
def _next_state(law, F, H, J):
    return (max(law.worst, of_fibres(law, F)),)


@dissipated_energy.of(TornFibres)
def _dissipated(law):
    return law.toughness - (law.worst + law.toughness) * exp(-law.worst / law.toughness)
