"""Energies of a change of volume, U(J) of bulk modulus K: the volumetric parts of laws of I1bar and of stretches."""

from typing import Annotated, Literal, NamedTuple

from parsolid.elementary import log
from parsolid.kernels import inlined
from parsolid.materials.declaration import Parameter
from parsolid.materials.law_functions import law_function


class SimoTaylor(NamedTuple):
    """K/4 (J^2 - 1 - 2 ln J) (Simo & Taylor, Comput. Methods Appl. Mech. Eng. 85 (1991) 273): infinite at J = 0."""


class Quadratic(NamedTuple):
    """K/2 (J - 1)^2."""


class Logarithmic(NamedTuple):
    """K/2 ln^2 J; not convex beyond J = e."""


KINDS = (("simo-taylor", SimoTaylor()), ("quadratic", Quadratic()), ("logarithmic", Logarithmic()))
# what a scene states of such a law: K, and the kind of its volumetric part
BulkModulus = Annotated[float, Parameter("Pa", "K of changes of the volume", above=0.0)]
VolumeKind = Annotated[
    Literal["simo-taylor", "quadratic", "logarithmic"],
    Parameter("1", "kind of the volumetric part", default="simo-taylor", kept=KINDS),
]


@law_function
def volume_energy(kind, K, J):
    """U [J/m^3]."""


@law_function
def volume_slopes(kind, K, J):
    """dU/dJ and d2U/dJ2 [Pa]."""


@inlined
def volume_terms(law, J):
    """`functions.volume_part` of a law with `volume`."""
    slope, curvature = volume_slopes(law.volume, law.bulk_modulus, J)
    return volume_energy(law.volume, law.bulk_modulus, J), slope, curvature


@volume_energy.of(SimoTaylor)
def _simo_taylor(kind, K, J):
    return 0.25 * K * ((J - 1.0) * (J + 1.0) - 2.0 * log(J))


@volume_slopes.of(SimoTaylor)
def _simo_taylor_slopes(kind, K, J):
    r = 1.0 / J
    return 0.5 * K * (J - 1.0) * (J + 1.0) * r, 0.5 * K * (1.0 + r * r)


@volume_energy.of(Quadratic)
def _quadratic(kind, K, J):
    return 0.5 * K * (J - 1.0) * (J - 1.0)


@volume_slopes.of(Quadratic)
def _quadratic_slopes(kind, K, J):
    return K * (J - 1.0), K


@volume_energy.of(Logarithmic)
def _logarithmic(kind, K, J):
    change = log(J)
    return 0.5 * K * change * change


@volume_slopes.of(Logarithmic)
def _logarithmic_slopes(kind, K, J):
    change, r = log(J), 1.0 / J
    return K * change * r, K * (1.0 - change) * r * r
