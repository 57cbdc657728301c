"""Mooney-Rivlin on four particles at once."""

import math

from decomposition.deferred import register_jitable
from parsolid.materials.hyperelastic.law import (
    elastic_moduli,
    equilibrium_energy,
    first_piola_kirchhoff_stress,
    isotropic_shear_modulus,
    pressure_wave_tensor,
    shear_wave_tensor,
    total_modulus,
)
from parsolid.materials.hyperelastic.mooney_rivlin import MooneyRivlin
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.tensors import I, contract, cross, gram, trace, zero_like_gram


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
    sigma_J = law.lambda_hat * (J - 1.0) - (_logarithmic(law.xi, law.zeta) + total_modulus(law.branch_moduli)) / J
    return 2.0 * law.xi * F + sigma_J * H + _area_stress(law.zeta, F, H) + _viscous_stress(F, branch_sum)


@shear_wave_tensor.of(MooneyRivlin)
def _shear_waves(law, F, branch_sum):
    # (59) averaged over both waves: 2 xi + zeta (lambda_1^2 + lambda_2^2) + N . branch_sum N
    return zero_like_gram(F) + _area_waves(law.zeta, F) + 2.0 * law.xi * I + branch_sum


@pressure_wave_tensor.of(MooneyRivlin)
def _pressure_waves(law, F, H, J, branch_sum):
    # (56), exact for every N: 2 xi + 2 zeta Lambda_T^2 + f'' Lambda_H^2 + sum mu_alpha (N . A N + Lambda_H^2 / J^2)
    curvature = law.lambda_hat + (_logarithmic(law.xi, law.zeta) + total_modulus(law.branch_moduli)) / (J * J)
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


@elastic_moduli.of(MooneyRivlin)
def _undeformed(law):
    zeta = _or_zero(law.zeta)
    return 2.0 * (law.xi + zeta), law.lambda_hat + 4.0 * zeta


@register_jitable
def _or_zero(zeta):
    if zeta is None:
        return 0.0
    return zeta


@equilibrium_energy.of(MooneyRivlin)
def _energy(law, F, H, J):
    # (19)
    W = law.xi * (contract(F, F) - 3.0) - _logarithmic(law.xi, law.zeta) * math.log(J)
    return _add_area_energy(W + 0.5 * law.lambda_hat * (J - 1.0) * (J - 1.0), law.zeta, H)
