"""Equations of state P = A(J) + gamma E: Mie-Grueneisen about a linear Hugoniot, and linear elasticity."""

import math
from typing import NamedTuple

from numba.extending import overload

from parsolid.materials.plastic.plasticity import (
    cold_pressure,
    grueneisen_coefficient,
    isentropic_bulk_modulus,
    room_to_compress,
)
from parsolid.numerics.dispatch import is_instance


class MieGrueneisen(NamedTuple):
    """U_s = C0 + S u_p, rho gamma = rho0 gamma0 (Banerjee, eq (4), with the full gamma in the place of 2 Gamma_0).

    density rho0 [kg/m^3], sound_speed C0 [m/s], slope S, gamma (the full Grueneisen coefficient, 2.02 for copper).
    """

    density: float
    sound_speed: float
    slope: float
    gamma: float


class LinearElastic(NamedTuple):
    """P = -K ln J, the rate form dP/dt = -K tr d; nothing of heat. bulk_modulus K [Pa]."""

    bulk_modulus: float


@overload(cold_pressure)
def _cold(eos, J):
    if is_instance(eos, MieGrueneisen):

        def hugoniot(eos, J):
            # P = P_H (1 - gamma x/2) + gamma E, P_H = rho0 C0^2 x/(1 - S x)^2, x = 1 - J
            x = 1.0 - J
            root = eos.sound_speed / (1.0 - eos.slope * x)
            return eos.density * root * root * x * (1.0 - 0.5 * eos.gamma * x)

        return hugoniot
    if is_instance(eos, LinearElastic):
        return lambda eos, J: -eos.bulk_modulus * math.log(J)


@overload(grueneisen_coefficient)
def _gamma(eos):
    if is_instance(eos, MieGrueneisen):
        return lambda eos: eos.gamma
    if is_instance(eos, LinearElastic):
        return lambda eos: 0.0


@overload(isentropic_bulk_modulus)
def _bulk(eos, J, pressure):
    if is_instance(eos, MieGrueneisen):

        def bulk(eos, J, pressure):
            # K = -J dP/dJ at constant E; along the isentrope dE = -P dJ
            x = 1.0 - J
            r = 1.0 / (1.0 - eos.slope * x)
            cold = eos.density * eos.sound_speed * eos.sound_speed * (1.0 + (eos.slope - eos.gamma) * x) * (r * r * r)
            return J * (cold + eos.gamma * pressure)

        return bulk
    if is_instance(eos, LinearElastic):
        return lambda eos, J, pressure: eos.bulk_modulus


@overload(room_to_compress)
def _room(eos, J):
    if is_instance(eos, MieGrueneisen):
        # at S (1 - J) = 1 the Hugoniot has no pressure left that is finite
        return lambda eos, J: min(J, 1.0 - eos.slope * (1.0 - J))
    if is_instance(eos, LinearElastic):
        return lambda eos, J: J
