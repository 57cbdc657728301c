"""Energies of a change of volume, U(J) of bulk modulus K: the volumetric parts of laws of I1bar and of stretches."""

from typing import Annotated, Any, Literal, NamedTuple

from parsolid.elementary import log
from parsolid.kernels import inlined
from parsolid.materials.declaration import Parameter
from parsolid.materials.law_functions import law_function

# what a scene states of such a law: the kind of its volumetric part, and K
VolumeKind = Annotated[
    Literal["simo-taylor", "quadratic", "logarithmic"],
    Parameter("1", "kind of the volumetric part", default="simo-taylor"),
]
BulkModulus = Annotated[float, Parameter("Pa", "K of changes of the volume", above=0.0)]


class SimoTaylor(NamedTuple):
    """K/4 (J^2 - 1 - 2 ln J) (Simo & Taylor, Comput. Methods Appl. Mech. Eng. 85 (1991) 273): infinite at J = 0."""

    bulk_modulus: float


class Quadratic(NamedTuple):
    """K/2 (J - 1)^2."""

    bulk_modulus: float


class Logarithmic(NamedTuple):
    """K/2 ln^2 J; not convex beyond J = e."""

    bulk_modulus: float


_PARTS: dict[str, Any] = {"simo-taylor": SimoTaylor, "quadratic": Quadratic, "logarithmic": Logarithmic}


def law_with_volume(law: Any, stated: Any, **others: Any) -> Any:
    """The law without branches from what a scene states; law: a NamedTuple of numbers that are stated under its names,
    and of others, then volume, branch_moduli and relaxation_times."""
    values = [others[name] if name in others else float(getattr(stated, name)) for name in law._fields[:-3]]
    return law(*values, _PARTS[stated.volume](float(stated.bulk_modulus)), None, None)


@law_function
def volume_energy(part, J):
    """U [J/m^3]."""


@law_function
def volume_slopes(part, J):
    """dU/dJ and d2U/dJ2 [Pa]."""


@inlined
def volume_terms(law, J):
    """`functions.volume_part` of a law with `volume`."""
    slope, curvature = volume_slopes(law.volume, J)
    return volume_energy(law.volume, J), slope, curvature


@volume_energy.of(SimoTaylor)
def _simo_taylor(part, J):
    return 0.25 * part.bulk_modulus * ((J - 1.0) * (J + 1.0) - 2.0 * log(J))


@volume_slopes.of(SimoTaylor)
def _simo_taylor_slopes(part, J):
    r = 1.0 / J
    return 0.5 * part.bulk_modulus * (J - 1.0) * (J + 1.0) * r, 0.5 * part.bulk_modulus * (1.0 + r * r)


@volume_energy.of(Quadratic)
def _quadratic(part, J):
    return 0.5 * part.bulk_modulus * (J - 1.0) * (J - 1.0)


@volume_slopes.of(Quadratic)
def _quadratic_slopes(part, J):
    return part.bulk_modulus * (J - 1.0), part.bulk_modulus


@volume_energy.of(Logarithmic)
def _logarithmic(part, J):
    change = log(J)
    return 0.5 * part.bulk_modulus * change * change


@volume_slopes.of(Logarithmic)
def _logarithmic_slopes(part, J):
    change, r = log(J), 1.0 / J
    return part.bulk_modulus * change * r, part.bulk_modulus * (1.0 - change) * r * r
