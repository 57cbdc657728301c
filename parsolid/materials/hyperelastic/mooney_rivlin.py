"""Polyconvex Mooney-Rivlin solid with Maxwell branches (Lee et al., eqs (19), (20), (A.1)).

W = xi (F:F - 3) + zeta (H:H - 3) - 2 (xi + 2 zeta) ln J + lambda_hat/2 (J - 1)^2
    + sum_alpha mu_alpha/2 [F^T F : A_alpha - 3 - ln(J^2 det A_alpha)],   A_alpha = C_v,alpha^{-1}
"""

import math
from typing import NamedTuple

from numba.extending import register_jitable

from parsolid.materials.hyperelastic.law import (
    equilibrium_energy,
    first_piola_kirchhoff_stress,
    isotropic_shear_modulus,
    pressure_wave_tensor,
    shear_wave_tensor,
)
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.tensors import I, contract, cross, gram, trace, zero_like_gram


class MooneyRivlin(NamedTuple):
    """Parameters in SI units; `zeta` is None for the neo-Hookean solid, the branches None without viscosity.

    density [kg/m^3], xi, zeta, lambda_hat [Pa]; branch_moduli [Pa] and relaxation_times [s] are tuples of equal length.
    """

    density: float
    xi: float
    zeta: float | None
    lambda_hat: float
    branch_moduli: tuple | None
    relaxation_times: tuple | None

    @property
    def directional_shear(self) -> bool:
        """Whether the shear wave speed depends on direction."""
        return self.zeta is not None or self.branch_moduli is not None


def of_material(material) -> MooneyRivlin:
    """The law of a scene's material."""
    moduli = material.moduli
    return MooneyRivlin(
        density=float(material.density),
        xi=float(moduli.xi),
        zeta=float(moduli.zeta) or None,
        lambda_hat=float(moduli.lambda_hat),
        branch_moduli=tuple(map(float, material.branch_moduli)) or None,
        relaxation_times=tuple(map(float, material.relaxation_times)) or None,
    )


@register_jitable
def _total(moduli):
    """sum_alpha mu_alpha [Pa]."""
    if moduli is None:
        return 0.0
    result = 0.0
    for modulus in moduli:
        result += modulus
    return result


@register_jitable
def _logarithmic(xi, zeta):
    """2 (xi + 2 zeta) [Pa], the factor of -ln J."""
    if zeta is None:
        return 2.0 * xi
    return 2.0 * (xi + 2.0 * zeta)


@none_without("zeta")
def _area_stress(zeta, F, H):
    """Sigma_H x F with Sigma_H = 2 zeta H."""
    return cross(2.0 * zeta * H, F)


@none_without("branch_sum")
def _viscous_stress(F, branch_sum):
    """F sum_alpha mu_alpha A_alpha."""
    return F @ branch_sum


@none_without("zeta")
def _area_waves(zeta, F):
    """zeta (tr C I - C), whose normal component is zeta (lambda_1^2 + lambda_2^2) of the surface normal to N."""
    C = gram(F)
    return -zeta * C + zeta * trace(C) * I


@none_without("zeta", "W")
def _add_area_energy(W, zeta, H):
    return W + zeta * (contract(H, H) - 3.0)


@none_without("zeta")
def _twice(zeta):
    return 2.0 * zeta


@first_piola_kirchhoff_stress.of(MooneyRivlin)
def _stress(law, F, H, J, branch_sum):
    # (A.1): P = Sigma_F + Sigma_H x F + Sigma_J H
    sigma_J = law.lambda_hat * (J - 1.0) - (_logarithmic(law.xi, law.zeta) + _total(law.branch_moduli)) / J
    return 2.0 * law.xi * F + sigma_J * H + _area_stress(law.zeta, F, H) + _viscous_stress(F, branch_sum)


@shear_wave_tensor.of(MooneyRivlin)
def _shear_waves(law, F, branch_sum):
    # (59) averaged over both waves: 2 xi + zeta (lambda_1^2 + lambda_2^2) + N . branch_sum N
    return zero_like_gram(F) + _area_waves(law.zeta, F) + 2.0 * law.xi * I + branch_sum


@pressure_wave_tensor.of(MooneyRivlin)
def _pressure_waves(law, F, H, J, branch_sum):
    # (56), exact for every N: 2 xi + 2 zeta Lambda_T^2 + f'' Lambda_H^2 + sum mu_alpha (N . A N + Lambda_H^2 / J^2)
    curvature = law.lambda_hat + (_logarithmic(law.xi, law.zeta) + _total(law.branch_moduli)) / (J * J)
    return curvature * gram(H) + 2.0 * law.xi * I + _area_waves(_twice(law.zeta), F) + branch_sum


@isotropic_shear_modulus.of(MooneyRivlin)
def _isotropic(law):
    return _without_direction(law.zeta, law.branch_moduli, law.xi)


@generic
def _without_direction(zeta, branch_moduli, xi):
    """2 xi [Pa] where there is neither zeta nor a branch, else None."""


@_without_direction.of(None)
def _without_area(zeta, branch_moduli, xi):
    return _without_branches(branch_moduli, xi)


@_without_direction.otherwise
def _with_area(zeta, branch_moduli, xi):
    return None


@generic
def _without_branches(branch_moduli, xi):
    """2 xi [Pa] where there is no branch, else None."""


@_without_branches.of(None)
def _neo_hookean(branch_moduli, xi):
    return 2.0 * xi


@_without_branches.otherwise
def _viscous(branch_moduli, xi):
    return None


@equilibrium_energy.of(MooneyRivlin)
def _energy(law, F, H, J):
    # (19)
    W = law.xi * (contract(F, F) - 3.0) - _logarithmic(law.xi, law.zeta) * math.log(J)
    return _add_area_energy(W + 0.5 * law.lambda_hat * (J - 1.0) * (J - 1.0), law.zeta, H)
