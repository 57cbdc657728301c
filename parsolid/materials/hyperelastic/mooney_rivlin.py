"""Polyconvex Mooney-Rivlin solid with Maxwell branches (Lee et al., eqs (19), (20), (A.1)).

W = xi (F:F - 3) + zeta (H:H - 3) - 2 (xi + 2 zeta) ln J + lambda_hat/2 (J - 1)^2
    + sum_alpha mu_alpha/2 [F^T F : A_alpha - 3 - ln(J^2 det A_alpha)],   A_alpha = C_v,alpha^{-1}
"""

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from parsolid.elementary import log
from parsolid.materials.declaration import Density, Parameter, Phrase, law
from parsolid.materials.hyperelastic.functions import (
    elastic_moduli,
    energy,
    isotropic_shear_modulus,
    pressure_waves,
    shear_waves,
    stress,
    volume_part,
)
from parsolid.tensors import add_spherical, combine, combine_symmetric, contract, cross, gram, times_symmetric


class MooneyRivlin(NamedTuple):
    """Parameters in SI units: density [kg/m^3], xi, zeta, lambda_hat [Pa]; branch_moduli [Pa] and relaxation_times [s]
    are tuples of equal length, None without viscosity."""

    density: float
    xi: float
    zeta: float
    lambda_hat: float
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


class NeoHookean(NamedTuple):
    """`MooneyRivlin` with zeta = 0, whose terms are left out."""

    density: float
    xi: float
    lambda_hat: float
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


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
        # of the two ways one is given as a whole
        stated: Any = self
        if self.youngs_modulus is None:
            shear, lame = 2.0 * (stated.xi + self.zeta), stated.lambda_hat + 4.0 * self.zeta
            xi, lambda_hat = stated.xi, stated.lambda_hat
        else:
            E, nu = stated.youngs_modulus, stated.poissons_ratio
            shear, lame = E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
            xi, lambda_hat = 0.5 * shear - self.zeta, lame - 4.0 * self.zeta
        return Moduli(xi, self.zeta, lambda_hat, shear, lame, lame + 2.0 / 3.0 * shear)

    @property
    def elastic_moduli(self) -> tuple[float, float]:
        """Shear modulus and first Lame constant [Pa] as stated, without the rounding of a way there and back."""
        return self.moduli.shear_modulus, self.moduli.first_lame

    def equilibrium_law(self) -> MooneyRivlin | NeoHookean:
        density, xi, zeta, lambda_hat = map(float, (self.density, *self.moduli[:3]))
        if zeta == 0.0:
            return NeoHookean(density, xi, lambda_hat, None, None)
        return MooneyRivlin(density, xi, zeta, lambda_hat, None, None)

    def faults(self) -> list[tuple[tuple[Any, ...], str, object]]:
        """Parameters of a solid that is not polyconvex."""
        if (self.youngs_modulus is None) != (self.poissons_ratio is None):
            return [((), "youngs_modulus with poissons_ratio, or xi with lambda_hat", Phrase("one of each"))]
        moduli = self.moduli
        details: list[tuple[tuple[Any, ...], str, object]] = []
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


@law("hyperelastic", "neo-hookean")
class StatedNeoHookean(StatedMooneyRivlin):
    """Mooney-Rivlin with zeta = 0, whose terms are left out."""

    zeta: Annotated[Literal[0, 0.0], Parameter(description="nothing but 0", default=0.0)]  # type: ignore[valid-type]


@energy.of(NeoHookean)
def _neo_hookean_energy(law, F, H, J):
    # (19)
    return law.xi * (contract(F, F) - 3.0) - 2.0 * law.xi * log(J) + 0.5 * law.lambda_hat * (J - 1.0) * (J - 1.0)


@energy.of(MooneyRivlin)
def _energy(law, F, H, J):
    # (19)
    chains = law.xi * (contract(F, F) - 3.0) + law.zeta * (contract(H, H) - 3.0)
    volume = 0.5 * law.lambda_hat * (J - 1.0) * (J - 1.0)
    return chains - 2.0 * (law.xi + 2.0 * law.zeta) * log(J) + volume


@stress.of(NeoHookean)
def _neo_hookean_stress(law, F, H, J):
    # (A.1): P = Sigma_F + Sigma_J H
    r = 1.0 / J
    return combine(2.0 * law.xi, F, law.lambda_hat * (J - 1.0) - 2.0 * law.xi * r, H)


@stress.of(MooneyRivlin)
def _stress(law, F, H, J):
    # (A.1): P = Sigma_F + Sigma_H x F + Sigma_J H, Sigma_H = 2 zeta H
    r = 1.0 / J
    sigma_J = law.lambda_hat * (J - 1.0) - 2.0 * (law.xi + 2.0 * law.zeta) * r
    return combine(1.0, combine(2.0 * law.xi, F, sigma_J, H), 2.0 * law.zeta, cross(H, F))


@pressure_waves.of(NeoHookean)
def _neo_hookean_pressure_waves(law, F, H, J):
    # (56), exact for every N: 2 xi + f'' Lambda_H^2
    r = 1.0 / J
    return add_spherical(times_symmetric(law.lambda_hat + 2.0 * law.xi * (r * r), gram(H)), 2.0 * law.xi)


@pressure_waves.of(MooneyRivlin)
def _pressure_waves(law, F, H, J):
    # (56), exact for every N: 2 xi + 2 zeta Lambda_T^2 + f'' Lambda_H^2. With C = F^T F the normal component of
    # tr C 1 - C is Lambda_T^2, the sum of squares of the principal stretches of the surface normal to N
    r = 1.0 / J
    curvature, C = law.lambda_hat + 2.0 * (law.xi + 2.0 * law.zeta) * (r * r), gram(F)
    waves = combine_symmetric(curvature, gram(H), -2.0 * law.zeta, C)
    return add_spherical(waves, 2.0 * law.xi + 2.0 * law.zeta * (C[0] + C[1] + C[2]))


@shear_waves.of(MooneyRivlin)
def _shear_waves(law, F):
    # (59) averaged over both waves: 2 xi + zeta Lambda_T^2
    C = gram(F)
    return add_spherical(times_symmetric(-law.zeta, C), 2.0 * law.xi + law.zeta * (C[0] + C[1] + C[2]))


@isotropic_shear_modulus.of(MooneyRivlin)
def _direction_dependent(law):
    return None


@elastic_moduli.of(NeoHookean)
def _neo_hookean_moduli(law):
    return 2.0 * law.xi, law.lambda_hat


@elastic_moduli.of(MooneyRivlin)
def _moduli(law):
    return 2.0 * (law.xi + law.zeta), law.lambda_hat + 4.0 * law.zeta


@volume_part.of(NeoHookean, MooneyRivlin)
def _volume(law, J):
    # what is left, of F:F, H:H and ln J, is of one sign and at rest without stress
    strain = J - 1.0
    return 0.5 * law.lambda_hat * strain * strain, law.lambda_hat * strain, law.lambda_hat
