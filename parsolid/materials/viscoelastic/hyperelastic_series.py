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

import math
from typing import NamedTuple

from decomposition.deferred import register_jitable
from parsolid.materials.hyperelastic.mooney_rivlin import MooneyRivlin
from parsolid.numerics.dispatch import none_without
from parsolid.numerics.tensors import I, contract, determinant, expand, inverse_symmetric, trace


class HyperelasticSeries(NamedTuple):
    """solid: that of equilibrium, without branches; ratios gamma_j and relaxation_times [s]: tuples of equal length."""

    density: float
    solid: MooneyRivlin
    ratios: tuple
    relaxation_times: tuple


@register_jitable
def second_piola_kirchhoff_stress(solid, C):
    """S0 [Pa] of a symmetric C: 2 xi I + 2 zeta (tr C I - C) + [lambda_hat (J - 1) - 2 (xi + 2 zeta)/J] J C^-1."""
    J = math.sqrt(determinant(expand(C)))
    inverse = inverse_symmetric(C)
    S = 2.0 * solid.xi * I + (solid.lambda_hat * (J - 1.0) * J - 2.0 * solid.xi) * inverse
    return _with_area(solid.zeta, C, inverse, S)


@none_without("zeta", returns="S")
def _with_area(zeta, C, inverse, S):
    return S + 2.0 * zeta * (trace(C) * I - C) + (-4.0 * zeta) * inverse


@register_jitable
def solid_energy(solid, C):
    """W [J/m^3] of a symmetric C of floats."""
    J = math.sqrt(determinant(expand(C)))
    W = solid.xi * (trace(C) - 3.0) - 2.0 * solid.xi * math.log(J) + 0.5 * solid.lambda_hat * (J - 1.0) * (J - 1.0)
    return _with_area_energy(solid.zeta, C, J, W)


@none_without("zeta", returns="W")
def _with_area_energy(zeta, C, J, W):
    # tr cof C = J^2 tr C^-1
    return W + zeta * (J * J * trace(inverse_symmetric(C)) - 3.0 - 4.0 * math.log(J))


@register_jitable
def branch_energy(solid, C, relaxed):
    """W(C) - W(C_j) - 1/2 S0(C_j) : (C - C_j) [J/m^3], over gamma_j."""
    tangent = 0.5 * contract(second_piola_kirchhoff_stress(solid, relaxed), C - relaxed)
    return solid_energy(solid, C) - solid_energy(solid, relaxed) - tangent


def of_material(material) -> HyperelasticSeries:
    """The law of a scene's Prony solid with a hyperelastic `base`."""
    constants = material.equilibrium
    G, lame = constants.shear_modulus, constants.bulk_modulus - 2.0 / 3.0 * constants.shear_modulus
    zeta = 0.5 * G * (material.area_share or 0.0)
    solid = MooneyRivlin(
        float(material.density), float(0.5 * G - zeta), float(zeta) or None, float(lame - 4.0 * zeta), None, None
    )
    stated = material.youngs_modulus or material.shear_modulus
    ratios = tuple(float(modulus / stated) for modulus in material.term_moduli)
    return HyperelasticSeries(float(material.density), solid, ratios, tuple(map(float, material.relaxation_times)))
