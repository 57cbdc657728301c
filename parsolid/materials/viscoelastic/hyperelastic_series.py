"""A Prony series on a neo-Hookean or Mooney-Rivlin solid: all of its stress relaxes in one ratio.

With the solid's energy W(C) and second Piola-Kirchhoff stress S0(C) = 2 dW/dC, branch j remembers C_j, the C to which
it has relaxed, and

    S = S0(C) + sum gamma_j [S0(C) - S0(C_j)],      dC_j/dt = (C - C_j)/tau_j,
    stored energy W(C) + sum gamma_j [W(C) - W(C_j) - 1/2 S0(C_j) : (C - C_j)].

A jump finds (1 + sum gamma_j) times the solid, and after a long time the solid alone is left; on St. Venant and
Kirchhoff's solid, whose S0 is linear in C, this is h_j <- a_j h_j + gamma_j A_j dS0 of Kaliske and Rothert (Comput.
Mech. 19, 1997). The branch's energy is that by which W lies above its tangent at C_j, and its loss
gamma_j/(4 tau_j) (C - C_j) : 4 d2W/dC2(C_j) : (C - C_j): neither is negative where W is convex in C. C_j is a mean of
past C, so that it stays positive definite.
"""

from typing import NamedTuple

from parsolid.elementary import log
from parsolid.kernels import inlined
from parsolid.materials.hyperelastic.mooney_rivlin import MooneyRivlin
from parsolid.tensors import (
    add_spherical,
    combine_symmetric,
    contract_symmetric,
    determinant_symmetric,
    inverse_symmetric,
    trace_symmetric,
)


class HyperelasticSeries(NamedTuple):
    """solid: that of equilibrium, without branches, its zeta a number; ratios gamma_j and relaxation_times [s]: tuples
    of equal length."""

    density: float
    solid: MooneyRivlin
    ratios: tuple[float, ...]
    relaxation_times: tuple[float, ...]


@inlined
def second_stress(solid, C):
    """S0 [Pa] of a symmetric C: 2 xi 1 + 2 zeta (tr C 1 - C) + [lambda_hat (J - 1) J - 2 xi - 4 zeta] C^-1."""
    J = determinant_symmetric(C) ** 0.5
    spherical = 2.0 * solid.xi + 2.0 * solid.zeta * trace_symmetric(C)
    along = solid.lambda_hat * (J - 1.0) * J - 2.0 * solid.xi - 4.0 * solid.zeta
    return add_spherical(combine_symmetric(along, inverse_symmetric(C), -2.0 * solid.zeta, C), spherical)


@inlined
def solid_energy(solid, C):
    """W [J/m^3] of a symmetric C; tr cof C = J^2 tr C^-1."""
    J = determinant_symmetric(C) ** 0.5
    area = J * J * trace_symmetric(inverse_symmetric(C)) - 3.0
    chains = solid.xi * (trace_symmetric(C) - 3.0) + solid.zeta * area
    return chains - 2.0 * (solid.xi + 2.0 * solid.zeta) * log(J) + 0.5 * solid.lambda_hat * (J - 1.0) * (J - 1.0)


@inlined
def branch_energy(solid, C, relaxed):
    """W(C) - W(C_j) - 1/2 S0(C_j) : (C - C_j) [J/m^3], over gamma_j: how far W lies above its tangent at C_j."""
    tangent = 0.5 * contract_symmetric(second_stress(solid, relaxed), combine_symmetric(1.0, C, -1.0, relaxed))
    return solid_energy(solid, C) - solid_energy(solid, relaxed) - tangent


def of_material(material) -> HyperelasticSeries:
    """The law of a scene's Prony solid with a hyperelastic `base`."""
    constants = material.equilibrium
    G, lame = constants.shear_modulus, constants.bulk_modulus - 2.0 / 3.0 * constants.shear_modulus
    zeta = 0.5 * G * (material.area_share or 0.0)
    solid = MooneyRivlin(
        float(material.density), float(0.5 * G - zeta), float(zeta), float(lame - 4.0 * zeta), None, None
    )
    stated = material.youngs_modulus or material.shear_modulus
    ratios = tuple(float(modulus / stated) for modulus in material.term_moduli)
    return HyperelasticSeries(float(material.density), solid, ratios, tuple(map(float, material.relaxation_times)))
