"""Linear elasticity in Green's strain, for large turns and small strain."""

from typing import Annotated, NamedTuple

from parsolid.materials.declaration import Density, Parameter, law
from parsolid.materials.hyperelastic.functions import elastic_moduli, energy, pressure_waves, stress
from parsolid.tensors import (
    add_spherical,
    combine_symmetric,
    contract_symmetric,
    general,
    gram,
    largest_eigenvalue_bound,
    matmul,
    times_symmetric,
    trace_symmetric,
)


class SaintVenantKirchhoff(NamedTuple):
    """See `StatedSaintVenantKirchhoff`."""

    density: float
    shear_modulus: float
    first_lame: float
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@law("hyperelastic", "saint-venant-kirchhoff")
class StatedSaintVenantKirchhoff:
    """lambda/2 (tr E)^2 + mu E:E of Green's strain E: linear elasticity of small strain. In compression it softens, and
    waves are lost."""

    density: Density
    youngs_modulus: Annotated[float, Parameter("Pa", "Young's modulus", above=0.0)]
    poissons_ratio: Annotated[float, Parameter("1", "Poisson's ratio", above=-1.0, below=0.5)]

    @property
    def elastic_moduli(self) -> tuple[float, float]:
        """Shear modulus and first Lame constant [Pa]."""
        E, nu = float(self.youngs_modulus), float(self.poissons_ratio)
        return E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))

    def equilibrium_law(self) -> SaintVenantKirchhoff:
        shear, lame = self.elastic_moduli
        return SaintVenantKirchhoff(float(self.density), shear, lame, None, None)


@energy.of(SaintVenantKirchhoff)
def _energy(law, F, H, J):
    E = times_symmetric(0.5, add_spherical(gram(F), -1.0))
    trace = trace_symmetric(E)
    return 0.5 * law.first_lame * trace * trace + law.shear_modulus * contract_symmetric(E, E)


@stress.of(SaintVenantKirchhoff)
def _stress(law, F, H, J):
    E = times_symmetric(0.5, add_spherical(gram(F), -1.0))
    S = add_spherical(times_symmetric(2.0 * law.shear_modulus, E), law.first_lame * trace_symmetric(E))
    return matmul(F, general(S))


@pressure_waves.of(SaintVenantKirchhoff)
def _waves(law, F, H, J):
    # of (N.SN) 1 + (lambda + mu) FN FN + mu F F^T, the acoustic tensor along N
    C = gram(F)
    E = times_symmetric(0.5, add_spherical(C, -1.0))
    S = add_spherical(times_symmetric(2.0 * law.shear_modulus, E), law.first_lame * trace_symmetric(E))
    most = law.shear_modulus * largest_eigenvalue_bound(C)
    return add_spherical(combine_symmetric(1.0, S, law.first_lame + law.shear_modulus, C), most)


@elastic_moduli.of(SaintVenantKirchhoff)
def _moduli(law):
    return law.shear_modulus, law.first_lame
