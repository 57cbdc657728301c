"""Solids with fibres: Holzapfel, Gasser & Ogden, without and with dispersion, of one or two families.

W = mu/2 (I1bar - 3) + U(J) + sum over families of k1/(2 k2) [exp(k2 <E>^2) - 1],
E = kappa tr C + (1 - 3 kappa) a.C a - 1 = M : C - 1,   M = kappa 1 + (1 - 3 kappa) a a

Fibres bear tension alone, <E> = max(E, 0): energy and stress are continuous there. E is that of the whole C, as fibres
of the isochoric part swell spheres to spheres (Nolan, Gower, Destrade, Ogden & McGarry, J. Mech. Behav. Biomed. Mater.
39 (2014) 48).
"""

from typing import Annotated, Any, NamedTuple

from parsolid.elementary import exp
from parsolid.kernels import inlined
from parsolid.materials.declaration import Density, Direction, Parameter, law
from parsolid.materials.hyperelastic.functions import elastic_moduli, energy, pressure_waves, stress, volume_part
from parsolid.materials.hyperelastic.rubbers import Yeoh
from parsolid.materials.hyperelastic.volume import KINDS, BulkModulus, VolumeKind
from parsolid.tensors import combine, combine_symmetric, contract, gram, plus, plus_symmetric, times

# the exponent that k2 E^2 counts for at most: e^80 of any stiffness stops a run
_MOST = 80.0
# k2 E^2 below which (exp(x) - 1)/x is a series
_SMALL = 1e-3

FIRST = Annotated[tuple[float, float, float], Direction("of the fibres")]
SECOND = Annotated[tuple[float, float, float], Direction("of a second family", needed=False)]


class OneFamily(NamedTuple):
    """See `StatedGasserOgdenHolzapfel`; matrix: the law of what is between the fibres."""

    density: float
    matrix: Any
    fibre_modulus: float
    fibre_exponent: float
    dispersion: float
    fibre: FIRST
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


class TwoFamilies(NamedTuple):
    """The law above with a second family of fibres of the same parameters."""

    density: float
    matrix: Any
    fibre_modulus: float
    fibre_exponent: float
    dispersion: float
    fibre: FIRST
    second_fibre: SECOND
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@law("hyperelastic", "holzapfel-gasser-ogden")
class StatedHolzapfelGasserOgden:
    """mu/2 (I1bar - 3) + U(J) and one or two families of fibres, k1/(2 k2) [exp(k2 <a.C a - 1>^2) - 1] (Holzapfel,
    Gasser & Ogden, J. Elasticity 61 (2000) 1). Fibres bear no compression."""

    density: Density
    shear_modulus: Annotated[float, Parameter("Pa", "mu of what is between the fibres", above=0.0)]
    bulk_modulus: BulkModulus
    volume: VolumeKind
    fibre_modulus: Annotated[float, Parameter("Pa", "k1 of a family", at_least=0.0)]
    fibre_exponent: Annotated[float, Parameter("1", "k2, 0: no stiffening", at_least=0.0)]
    fibre: FIRST
    second_fibre: SECOND

    @property
    def bears_tension_alone(self) -> bool:
        """Whether the stiffness at rest is one in tension and another in compression."""
        return True

    def equilibrium_law(self) -> Any:
        density, shear, bulk = float(self.density), float(self.shear_modulus), float(self.bulk_modulus)
        volume: Any = dict(KINDS)[self.volume]
        matrix = Yeoh(density, 0.5 * shear, 0.0, 0.0, bulk, volume, None, None)
        numbers = (float(self.fibre_modulus), float(self.fibre_exponent), float(getattr(self, "dispersion", 0.0)))
        directions = [Direction().at_rest] * (1 if self.second_fibre is None else 2)
        kind: Any = OneFamily if self.second_fibre is None else TwoFamilies
        return kind(density, matrix, *numbers, *directions, None, None)


@law("hyperelastic", "gasser-ogden-holzapfel")
class StatedGasserOgdenHolzapfel(StatedHolzapfelGasserOgden):
    """Tissue of dispersed fibres, E = kappa tr C + (1 - 3 kappa) a.C a - 1 (Gasser, Ogden & Holzapfel, J. R. Soc.
    Interface 3 (2006) 15)."""

    dispersion: Annotated[float, Parameter("1", "kappa: 0 aligned, 1/3 isotropic", at_least=0.0, at_most=1.0 / 3.0)]


@inlined
def stretched(law, F, a):
    """F M and <E> of a family along a."""
    part = 1.0 - 3.0 * law.dispersion
    f = (F[0] * a[0] + F[1] * a[1] + F[2] * a[2], F[3] * a[0] + F[4] * a[1] + F[5] * a[2],
         F[6] * a[0] + F[7] * a[1] + F[8] * a[2])  # fmt: skip
    outer = (f[0] * a[0], f[0] * a[1], f[0] * a[2], f[1] * a[0], f[1] * a[1], f[1] * a[2],
             f[2] * a[0], f[2] * a[1], f[2] * a[2])  # fmt: skip
    FM = combine(law.dispersion, F, part, outer)
    return FM, max(contract(FM, F) - 1.0, 0.0)


@inlined
def fibre_energy(law, F, a):
    """Energy [J/m^3] of a family."""
    _, E = stretched(law, F, a)
    x = min(law.fibre_exponent * E * E, _MOST)
    series = 1.0 + x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x / 120.0)))
    growth = series if x < _SMALL else (exp(x) - 1.0) / max(x, _SMALL)
    return 0.5 * law.fibre_modulus * E * E * growth


@inlined
def fibre_stress(law, F, a):
    """P [Pa] of a family, 2 W' F M."""
    FM, E = stretched(law, F, a)
    return times(2.0 * law.fibre_modulus * E * exp(min(law.fibre_exponent * E * E, _MOST)), FM)


@inlined
def fibre_waves(law, F, a):
    """Q [Pa] of a family, 2 W' M + 4 W'' M C M exactly in tension; without W' in compression, where W'' counts, too, as
    it jumps at E = 0."""
    FM, E = stretched(law, F, a)
    x = law.fibre_exponent * E * E
    grown = law.fibre_modulus * exp(min(x, _MOST))
    kappa, part, slope = law.dispersion, 1.0 - 3.0 * law.dispersion, 2.0 * grown * E
    M = (kappa + part * a[0] * a[0], kappa + part * a[1] * a[1], kappa + part * a[2] * a[2],
         part * a[0] * a[1], part * a[0] * a[2], part * a[1] * a[2])  # fmt: skip
    return combine_symmetric(slope, M, 4.0 * grown * (1.0 + 2.0 * x), gram(FM))


@energy.of(OneFamily)
def _energy(law, F, H, J):
    return energy(law.matrix, F, H, J) + fibre_energy(law, F, law.fibre)


@energy.of(TwoFamilies)
def _energy_of_two(law, F, H, J):
    return energy(law.matrix, F, H, J) + fibre_energy(law, F, law.fibre) + fibre_energy(law, F, law.second_fibre)


@stress.of(OneFamily)
def _stress(law, F, H, J):
    return plus(stress(law.matrix, F, H, J), fibre_stress(law, F, law.fibre))


@stress.of(TwoFamilies)
def _stress_of_two(law, F, H, J):
    of_fibres = plus(fibre_stress(law, F, law.fibre), fibre_stress(law, F, law.second_fibre))
    return plus(stress(law.matrix, F, H, J), of_fibres)


@pressure_waves.of(OneFamily)
def _waves(law, F, H, J):
    return plus_symmetric(pressure_waves(law.matrix, F, H, J), fibre_waves(law, F, law.fibre))


@pressure_waves.of(TwoFamilies)
def _waves_of_two(law, F, H, J):
    of_fibres = plus_symmetric(fibre_waves(law, F, law.fibre), fibre_waves(law, F, law.second_fibre))
    return plus_symmetric(pressure_waves(law.matrix, F, H, J), of_fibres)


@elastic_moduli.of(OneFamily, TwoFamilies)
def _moduli(law):
    # of what is between the fibres, which alone bears shear and compression at rest
    return elastic_moduli(law.matrix)


@volume_part.of(OneFamily, TwoFamilies)
def _volume(law, J):
    return volume_part(law.matrix, J)
