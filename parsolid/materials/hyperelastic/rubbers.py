"""Rubbers whose energy is a function of I1bar = J^-2/3 F:F, and a volumetric part: Yeoh, Gent, Arruda & Boyce.

W = w(I1bar - 3) + U(J). A law of this kind is a NamedTuple with `volume` and a function `chain`.
"""

import math
from typing import Annotated, NamedTuple

from parsolid.elementary import exp, log
from parsolid.kernels import inlined
from parsolid.materials.declaration import Density, Parameter, law
from parsolid.materials.hyperelastic.functions import elastic_moduli, energy, pressure_waves, stress, volume_part
from parsolid.materials.hyperelastic.volume import (
    BulkModulus,
    VolumeKind,
    volume_energy,
    volume_slopes,
    volume_terms,
)
from parsolid.materials.law_functions import law_function
from parsolid.tensors import add_spherical, combine, combine_symmetric, contract, gram


@law_function
def chain(law, x):
    """w [J/m^3] and its first two derivatives [Pa] at x = I1bar - 3."""


@law("hyperelastic", "yeoh")
class Yeoh(NamedTuple):
    """sum c_i (I1bar - 3)^i + U(J), i = 1, 2, 3 (Yeoh, Rubber Chem. Technol. 66 (1993) 754); mu = 2 c1."""

    density: Density
    c1: Annotated[float, Parameter("Pa", "half the shear modulus", above=0.0)]
    c2: Annotated[float, Parameter("Pa", "factor of the square", default=0.0)]
    c3: Annotated[float, Parameter("Pa", "factor of the cube", default=0.0)]
    bulk_modulus: BulkModulus
    volume: VolumeKind
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@law("hyperelastic", "gent")
class Gent(NamedTuple):
    """-mu J_m/2 ln(1 - (I1bar - 3)/J_m) + U(J) (Gent, Rubber Chem. Technol. 69 (1996) 59): at I1bar - 3 = J_m chains
    are stretched out, and the run stops."""

    density: Density
    shear_modulus: Annotated[float, Parameter("Pa", "mu", above=0.0)]
    limit: Annotated[float, Parameter("1", "J_m", above=0.0)]
    bulk_modulus: BulkModulus
    volume: VolumeKind
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@law("hyperelastic", "arruda-boyce")
class ArrudaBoyce(NamedTuple):
    """Eight chains, five terms: modulus sum c_i/locking_stretch^(2i-2) (I1bar^i - 3^i) + U(J), c = 1/2, 1/20, 11/1050,
    19/7000, 519/673750 (Arruda & Boyce, J. Mech. Phys. Solids 41 (1993) 389). The shear modulus at rest is larger."""

    density: Density
    modulus: Annotated[float, Parameter("Pa", "n k T of the chains", above=0.0)]
    locking_stretch: Annotated[float, Parameter("1", "lambda_m", above=1.0)]
    bulk_modulus: BulkModulus
    volume: VolumeKind
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@chain.of(Yeoh)
def _yeoh(law, x):
    w = x * (law.c1 + x * (law.c2 + x * law.c3))
    return w, law.c1 + x * (2.0 * law.c2 + x * 3.0 * law.c3), 2.0 * law.c2 + 6.0 * law.c3 * x


@chain.of(Gent)
def _gent(law, x):
    left = 1.0 - x / law.limit
    # not a number beyond the limit, where the run stops
    r = 1.0 / left if left > 0.0 else math.nan
    half = 0.5 * law.shear_modulus
    return -half * law.limit * log(max(left, 1e-300)) * (left * r), half * r, half / law.limit * r * r


@chain.of(ArrudaBoyce)
def _arruda_boyce(law, x):
    # I^(i + 1) - 3^(i + 1) = I (I^i - 3^i) + 3^i (I - 3), in which nothing large cancels
    first, q = x + 3.0, 1.0 / (law.locking_stretch * law.locking_stretch)
    second = first * x + 3.0 * x
    third = first * second + 9.0 * x
    fourth = first * third + 27.0 * x
    fifth = first * fourth + 81.0 * x
    c1, c2, c3, c4, c5 = 0.5, q / 20.0, 11.0 * q * q / 1050.0, 19.0 * q**3 / 7000.0, 519.0 * q**4 / 673750.0
    w = c1 * x + c2 * second + c3 * third + c4 * fourth + c5 * fifth
    slope = c1 + first * (2.0 * c2 + first * (3.0 * c3 + first * (4.0 * c4 + first * 5.0 * c5)))
    curvature = 2.0 * c2 + first * (6.0 * c3 + first * (12.0 * c4 + first * 20.0 * c5))
    return law.modulus * w, law.modulus * slope, law.modulus * curvature


@inlined
def _excess(F, J):
    """I1bar - 3, J^-2/3 and I1."""
    first, shrink = contract(F, F), exp(-2.0 / 3.0 * log(J))
    return shrink * first - 3.0, shrink, first


@energy.of(Yeoh, Gent, ArrudaBoyce)
def _energy(law, F, H, J):
    return chain(law, _excess(F, J)[0])[0] + volume_energy(law.volume, law.bulk_modulus, J)


@stress.of(Yeoh, Gent, ArrudaBoyce)
def _stress(law, F, H, J):
    x, shrink, first = _excess(F, J)
    g = 2.0 * chain(law, x)[1] * shrink
    return combine(g, F, volume_slopes(law.volume, law.bulk_modulus, J)[0] - g * first / (3.0 * J), H)


@pressure_waves.of(Yeoh, Gent, ArrudaBoyce)
def _waves(law, F, H, J):
    # a bound of the acoustic tensor over all polarisations, the volumetric part exactly
    x, shrink, first = _excess(F, J)
    _, slope, curvature = chain(law, x)
    g, stiffer = 2.0 * slope * shrink, 4.0 * max(curvature, 0.0) * shrink * shrink
    HH, r = gram(H), 1.0 / (J * J)
    k = 0.5 * max(first * contract(H, H) * r - 9.0, 0.0) ** 0.5
    of_inverse = (5.0 / 9.0 * g * first + stiffer * first * first / 9.0) * r
    of_volume = max(volume_slopes(law.volume, law.bulk_modulus, J)[1], 0.0)
    waves = combine_symmetric(of_inverse + of_volume, HH, stiffer, gram(F))
    return add_spherical(waves, g * (2.0 * k - 1.0) / 3.0 - 2.0 / 3.0 * stiffer * first)


@elastic_moduli.of(Yeoh, Gent, ArrudaBoyce)
def _moduli(law):
    shear = 2.0 * chain(law, 0.0)[1]
    return shear, law.bulk_modulus - 2.0 / 3.0 * shear


volume_part.of(Yeoh, Gent, ArrudaBoyce)(volume_terms)
