"""Polyconvex Mooney-Rivlin solid with Maxwell branches (Lee et al., eqs (19), (20), (A.1)).

W = xi (F:F - 3) + zeta (H:H - 3) - 2 (xi + 2 zeta) ln J + lambda_hat/2 (J - 1)^2
    + sum_alpha mu_alpha/2 [F^T F : A_alpha - 3 - ln(J^2 det A_alpha)],   A_alpha = C_v,alpha^{-1}
"""

import math
from typing import Annotated, ClassVar, NamedTuple

from decomposition.deferred import register_jitable
from parsolid.materials.declaration import Density, Parameter, Phrase, law
from parsolid.materials.hyperelastic.law import (
    elastic_moduli,
    equilibrium_energy,
    first_piola_kirchhoff_stress,
    isotropic_shear_modulus,
    pressure_wave_tensor,
    shear_wave_tensor,
    total_modulus,
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


class Moduli(NamedTuple):
    """Elastic constants of the equilibrium law in the undeformed state, all in Pa."""

    xi: float
    zeta: float
    lambda_hat: float
    shear_modulus: float
    first_lame: float
    bulk_modulus: float


@law("hyperelastic", "mooney-rivlin")
class StatedMooneyRivlin:
    """Polyconvex Mooney-Rivlin solid with Maxwell branches (Lee et al., eqs (19), (20)).

    The equilibrium law is given either by `youngs_modulus` and `poissons_ratio` (with `zeta`, 0 unless given) or by
    `xi`, `zeta` and `lambda_hat`: mu = 2 (xi + zeta), lambda = lambda_hat + 4 zeta.
    """

    exactly_one: ClassVar = (("youngs_modulus", "xi"), ("poissons_ratio", "lambda_hat"))
    density: Density
    youngs_modulus: Annotated[float | None, Parameter("Pa", "Young's modulus", above=0.0, default=None)]
    poissons_ratio: Annotated[float | None, Parameter("1", "Poisson's ratio", above=-1.0, below=0.5, default=None)]
    xi: Annotated[float | None, Parameter("Pa", "the factor of F:F - 3", at_least=0.0, default=None)]
    zeta: Annotated[float, Parameter("Pa", "the factor of H:H - 3", at_least=0.0, default=0.0)]
    lambda_hat: Annotated[float | None, Parameter("Pa", "twice the factor of (J - 1)^2", at_least=0.0, default=None)]

    @property
    def moduli(self) -> Moduli:
        """xi, zeta, lambda_hat and the linear elastic constants [Pa]."""
        if self.youngs_modulus is None:
            shear, lame = 2.0 * (self.xi + self.zeta), self.lambda_hat + 4.0 * self.zeta
            xi, lambda_hat = self.xi, self.lambda_hat
        else:
            E, nu = self.youngs_modulus, self.poissons_ratio
            shear, lame = E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
            xi, lambda_hat = 0.5 * shear - self.zeta, lame - 4.0 * self.zeta
        return Moduli(xi, self.zeta, lambda_hat, shear, lame, lame + 2.0 / 3.0 * shear)

    @property
    def elastic_moduli(self) -> tuple[float, float]:
        """Shear modulus and first Lame constant [Pa] as stated, without the rounding of a way there and back."""
        return self.moduli.shear_modulus, self.moduli.first_lame

    def equilibrium_law(self) -> MooneyRivlin:
        """The law without branches."""
        moduli = self.moduli
        zeta = float(moduli.zeta) or None
        return MooneyRivlin(float(self.density), float(moduli.xi), zeta, float(moduli.lambda_hat), None, None)

    def faults(self) -> list[tuple[tuple, str, object]]:
        """What is not a polyconvex solid."""
        if (self.youngs_modulus is None) != (self.poissons_ratio is None):
            return [((), "youngs_modulus with poissons_ratio, or xi with lambda_hat", Phrase("one of each"))]
        moduli, details = self.moduli, []
        if moduli.shear_modulus <= 0.0:
            details.append((("xi",), "xi + zeta > 0", moduli.xi + moduli.zeta))
        if moduli.xi < 0.0:
            bound = f"zeta <= mu/2 = {0.5 * moduli.shear_modulus:g} (xi = mu/2 - zeta >= 0)"
            details.append((("zeta",), bound, self.zeta))
        elif moduli.lambda_hat < 0.0:
            # with lambda_hat < 0 the law is not polyconvex and loses real wave speeds in extension
            bound = "lambda_hat = lambda - 4 zeta >= 0 (polyconvexity)"
            details.append((("poissons_ratio",), f"a value with {bound}", self.poissons_ratio))
        return details


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
