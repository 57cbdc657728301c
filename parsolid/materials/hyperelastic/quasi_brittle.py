"""Damage of concrete by Mazars, with a fracture energy that does not depend on the spacing.

Hencky's energy mu dev e : dev e + K/2 (tr e)^2 of the logarithmic strain e = ln U, with principal values e_i, loses the
part D of it but for the pressure of compression, which closed cracks and rubble go on bearing. D grows with

    kappa = (sum <e_i>^2)^1/2,   D = alpha D_t + (1 - alpha) D_c,   <x> = max(x, 0),   kappa_0 = f_t/E
    D_t = 1 - kappa_0/kappa exp(-(kappa - kappa_0)/(kappa_f - kappa_0)),   kappa_f = kappa_0/2 + G_f/(E kappa_0 h)
    D_c = 1 - kappa_0 (1 - A)/kappa - A exp(-B (kappa - kappa_0))

and never falls. alpha is the share of kappa^2 that tensile stress makes, 1 in tension and 0 in uniaxial compression
(Mazars, Eng. Fract. Mech. 25 (1986) 729). A band of the width h takes G_f a unit of area on its way to D = 1 (Bazant &
Oh, Mater. Struct. 16 (1983) 155).
"""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp
from parsolid.kernels import inlined
from parsolid.materials.declaration import BandWidth, Density, Parameter, StateVariable, law
from parsolid.materials.hyperelastic.functions import (
    dissipated_energy,
    elastic_moduli,
    energy,
    isotropic_shear_modulus,
    next_state,
    pressure_waves,
    shear_waves,
    stress,
)
from parsolid.materials.hyperelastic.stretches import logarithms, stress_of_logarithms, waves_of_logarithms

# what is left of the stiffness keeps waves and the equations of broken matter sound
_MOST = 1.0 - 1e-6

BAND = Annotated[float, BandWidth("a crack, over which its energy is spread")]
DAMAGE = Annotated[float, StateVariable("1", "share of the stiffness that is lost")]
UNDAMAGED = Annotated[float, StateVariable("J/m^3", "energy that damage takes its share of, without damage")]
LOST = Annotated[float, StateVariable("J/m^3", "energy that damage has dissipated")]


class Mazars(NamedTuple):
    """See `StatedMazars`; threshold: kappa_0."""

    density: float
    shear_modulus: float
    bulk_modulus: float
    threshold: float
    fracture_energy: float
    compression_factor: float
    compression_exponent: float
    band: BAND
    damage: DAMAGE
    undamaged_energy: UNDAMAGED
    damage_dissipation: LOST
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@law("hyperelastic", "mazars")
class StatedMazars:
    """Concrete: elastic in logarithmic strain, with Mazars's damage in tension and compression. In tension stress falls
    exponentially from f_t so that a crack takes the fracture energy whatever the spacing."""

    density: Density
    youngs_modulus: Annotated[float, Parameter("Pa", "Young's modulus E", above=0.0)]
    poissons_ratio: Annotated[float, Parameter("1", "Poisson's ratio", at_least=0.0, below=0.5)]
    tensile_strength: Annotated[float, Parameter("Pa", "f_t", above=0.0)]
    fracture_energy: Annotated[float, Parameter("J/m^2", "G_f of a crack in tension", above=0.0)]
    compression_factor: Annotated[float, Parameter("1", "A of damage in compression", at_least=0.0, default=1.4)]
    compression_exponent: Annotated[float, Parameter("1", "B of damage in compression", above=0.0, default=1900.0)]
    band: BAND
    damage: DAMAGE
    undamaged_energy: UNDAMAGED
    damage_dissipation: LOST

    @property
    def largest_band(self) -> float:
        """Width [m] of a band that stores the fracture energy when it reaches the strength: wider ones snap back."""
        E, strength = float(self.youngs_modulus), float(self.tensile_strength)
        return 2.0 * E * float(self.fracture_energy) / strength**2

    def equilibrium_law(self) -> Mazars:
        E, nu = float(self.youngs_modulus), float(self.poissons_ratio)
        numbers = (float(self.fracture_energy), float(self.compression_factor), float(self.compression_exponent))
        threshold, moduli = float(self.tensile_strength) / E, (E / (2.0 * (1.0 + nu)), E / (3.0 * (1.0 - 2.0 * nu)))
        return Mazars(float(self.density), *moduli, threshold, *numbers, 0.5 * self.largest_band, 0.0, 0.0, 0.0, None,
                      None)  # fmt: skip


@inlined
def _energies(law, e, trace):
    """Energies [J/m^3] without damage: what damage takes its share of, and what it leaves."""
    of_volume, mean = 0.5 * law.bulk_modulus * trace * trace, trace / 3.0
    a, b, c = e[0] - mean, e[1] - mean, e[2] - mean
    of_shape = law.shear_modulus * (a * a + b * b + c * c)
    return of_shape + (of_volume if trace > 0.0 else 0.0), (0.0 if trace > 0.0 else of_volume)


@inlined
def _damage(law, e, trace):
    """D of a strain that is reached for the first time."""
    k0, mu = law.threshold, law.shear_modulus
    E = 9.0 * law.bulk_modulus * mu / (3.0 * law.bulk_modulus + mu)
    a, b, c = max(e[0], 0.0), max(e[1], 0.0), max(e[2], 0.0)
    square = a * a + b * b + c * c
    kappa = max(square**0.5, k0)
    # tensile parts of the stress over 2 mu, and of the strain that they make
    spherical = (law.bulk_modulus - 2.0 / 3.0 * mu) * trace / (2.0 * mu)
    s, t, u = max(e[0] + spherical, 0.0), max(e[1] + spherical, 0.0), max(e[2] + spherical, 0.0)
    nu = 0.5 * E / mu - 1.0
    across = nu / (1.0 + nu) * (s + t + u)
    share = (a * (s - across) + b * (t - across) + c * (u - across)) / (kappa * kappa)
    share = min(max(share, 0.0), 1.0)
    softening = law.fracture_energy / (E * k0 * law.band) - 0.5 * k0
    in_tension = 1.0 - k0 / kappa * exp(-(kappa - k0) / softening)
    factor = law.compression_factor
    in_compression = 1.0 - k0 * (1.0 - factor) / kappa - factor * exp(-law.compression_exponent * (kappa - k0))
    return min(share * in_tension + (1.0 - share) * in_compression, _MOST)


@energy.of(Mazars)
def _energy(law, F, H, J):
    _, _, e, trace = logarithms(F)
    weak, kept = _energies(law, e, trace)
    return (1.0 - law.damage) * weak + kept


@inlined
def _slopes(law, e, trace):
    """dW/d ln lambda_i, twice the shear modulus and the first Lame constant [Pa] with damage."""
    whole = 1.0 - law.damage
    mu, K = whole * law.shear_modulus, law.bulk_modulus * (whole if trace > 0.0 else 1.0)
    lame = K - 2.0 / 3.0 * mu
    of_volume = lame * trace
    return (2.0 * mu * e[0] + of_volume, 2.0 * mu * e[1] + of_volume, 2.0 * mu * e[2] + of_volume), 2.0 * mu, lame


@stress.of(Mazars)
def _stress(law, F, H, J):
    squares, axes, e, trace = logarithms(F)
    return stress_of_logarithms(F, squares, axes, _slopes(law, e, trace)[0])


@pressure_waves.of(Mazars)
def _waves(law, F, H, J):
    squares, axes, e, trace = logarithms(F)
    t, twice, lame = _slopes(law, e, trace)
    same = twice + lame
    return waves_of_logarithms(squares, axes, t, (same, same, same, lame, lame, lame))


@shear_waves.of(Mazars)
def _shear_waves(law, F):
    mu = (1.0 - law.damage) * law.shear_modulus
    return (mu, mu, mu, 0.0, 0.0, 0.0)


@isotropic_shear_modulus.of(Mazars)
def _isotropic(law):
    # it falls with damage
    return None


@elastic_moduli.of(Mazars)
def _moduli(law):
    return law.shear_modulus, law.bulk_modulus - 2.0 / 3.0 * law.shear_modulus


@next_state.of(Mazars)
def _next_state(law, F, H, J):
    _, _, e, trace = logarithms(F)
    damage, (weak, _) = max(law.damage, _damage(law, e, trace)), _energies(law, e, trace)
    # of the mean energy of the step, of second order
    lost = 0.5 * (weak + law.undamaged_energy) * (damage - law.damage)
    return damage, weak, law.damage_dissipation + lost


@dissipated_energy.of(Mazars)
def _dissipated(law):
    return law.damage_dissipation
