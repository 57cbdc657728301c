"""Equations of state P = A(J) + gamma E: Mie-Grueneisen about a linear Hugoniot, and linear elasticity."""

from typing import Annotated, NamedTuple

from parsolid.elementary import log
from parsolid.materials.declaration import OfMaterial, Parameter, law
from parsolid.materials.plastic.functions import (
    cold_pressure,
    grueneisen_coefficient,
    isentropic_bulk_modulus,
    room_to_compress,
)


@law("equation-of-state", "mie-grueneisen")
class MieGrueneisen(NamedTuple):
    """U_s = C0 + S u_p, rho gamma = rho0 gamma0 (Banerjee, eq (4), with the full gamma in the place of 2 Gamma_0).

    density rho0 [kg/m^3], sound_speed C0 [m/s], slope S, gamma (the full Grueneisen coefficient, 2.02 for copper).
    """

    density: Annotated[float, OfMaterial()]
    sound_speed: Annotated[float, Parameter("m/s", "C0", above=0.0)]
    slope: Annotated[float, Parameter("1", "S", at_least=1.0)]
    gamma: Annotated[float, Parameter("1", "the full Grueneisen coefficient, 2.02 for copper", at_least=0.0)]


@law("equation-of-state", "linear")
class LinearElastic(NamedTuple):
    """P = -K ln J, the rate form dP/dt = -K tr d; nothing of heat. bulk_modulus K [Pa]."""

    bulk_modulus: Annotated[float, Parameter("Pa", "K", above=0.0)]


@cold_pressure.of(MieGrueneisen)
def _hugoniot(eos, J):
    # P = P_H (1 - gamma x/2) + gamma E, P_H = rho0 C0^2 x/(1 - S x)^2, x = 1 - J
    x = 1.0 - J
    root = eos.sound_speed / (1.0 - eos.slope * x)
    return eos.density * root * root * x * (1.0 - 0.5 * eos.gamma * x)


@grueneisen_coefficient.of(MieGrueneisen)
def _gamma(eos):
    return eos.gamma


@isentropic_bulk_modulus.of(MieGrueneisen)
def _bulk(eos, J, pressure):
    # K = -J dP/dJ at constant E; along the isentrope dE = -P dJ
    x = 1.0 - J
    r = 1.0 / (1.0 - eos.slope * x)
    cold = eos.density * eos.sound_speed * eos.sound_speed * (1.0 + (eos.slope - eos.gamma) * x) * (r * r * r)
    return J * (cold + eos.gamma * pressure)


@room_to_compress.of(MieGrueneisen)
def _room(eos, J):
    # at S (1 - J) = 1 the Hugoniot has no pressure left that is finite
    return min(J, 1.0 - eos.slope * (1.0 - J))


@cold_pressure.of(LinearElastic)
def _linear(eos, J):
    return -eos.bulk_modulus * log(J)


@grueneisen_coefficient.of(LinearElastic)
def _no_heat(eos):
    return 0.0


@isentropic_bulk_modulus.of(LinearElastic)
def _linear_bulk(eos, J, pressure):
    return eos.bulk_modulus


@room_to_compress.of(LinearElastic)
def _any_room(eos, J):
    return J
