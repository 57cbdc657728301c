"""Shear moduli mu(P, T); none falls below a hundredth of its value at P = 0, T = 0, where the waves need some stiffness."""

import math
from typing import NamedTuple

from parsolid.materials.plastic.plasticity import shear_modulus
from parsolid.numerics.elementary import power

_LEAST = 0.01


class ConstantShearModulus(NamedTuple):
    """modulus mu [Pa]."""

    modulus: float


class SteinbergShearModulus(NamedTuple):
    """mu = mu0 [1 + A P J^(1/3) - B (T - 300)] (Steinberg, Cochran & Guinan 1980), 1/J = eta.

    modulus mu0 [Pa] at 300 K, pressure_coefficient A [1/Pa], temperature_coefficient B [1/K].
    """

    modulus: float
    pressure_coefficient: float
    temperature_coefficient: float


class NadalLePoac(NamedTuple):
    """mu of Nadal & Le Poac 2003, with a fall to zero at melting.

    modulus mu0 [Pa], pressure_coefficient d(mu)/dP / mu0 [1/Pa], width zeta, lindemann C, atomic_mass [kg], density [kg/m^3].
    """

    modulus: float
    pressure_coefficient: float
    width: float
    lindemann: float
    atomic_mass: float
    density: float


class Varshni(NamedTuple):
    """mu = mu0 - D / (exp(T0/T) - 1) (Varshni 1970; Chen & Gray 1996): modulus mu0, drop D [Pa], temperature T0 [K]."""

    modulus: float
    drop: float
    temperature: float


class LinearSoftening(NamedTuple):
    """mu = G0 (1 - alpha T/T_m) (Preston, Tonks & Wallace 2003, eq (12)): modulus G0 [Pa], softening alpha."""

    modulus: float
    softening: float


_BOLTZMANN = 1.380649e-23


@shear_modulus.of(ConstantShearModulus)
def _constant(model, J, pressure, temperature, melting_temperature):
    return model.modulus


@shear_modulus.of(SteinbergShearModulus)
def _steinberg(model, J, pressure, temperature, melting_temperature):
    hardened = 1.0 + model.pressure_coefficient * pressure * power(J, 1.0 / 3.0)
    return model.modulus * max(hardened - model.temperature_coefficient * (temperature - 300.0), _LEAST)


@shear_modulus.of(NadalLePoac)
def _nadal_le_poac(model, J, pressure, temperature, melting_temperature):
    homologous = min(temperature / melting_temperature, 1.0 - 1e-9)
    cold = model.modulus * (1.0 + model.pressure_coefficient * pressure * power(J, 1.0 / 3.0)) * (1.0 - homologous)
    thermal = model.density / (J * model.lindemann * model.atomic_mass) * _BOLTZMANN * temperature
    fall = 1.0 + math.exp(-(1.0 + 1.0 / model.width) / (1.0 + model.width / (1.0 - homologous)))
    return max((cold + thermal) / fall, _LEAST * model.modulus)


@shear_modulus.of(Varshni)
def _varshni(model, J, pressure, temperature, melting_temperature):
    drop = model.drop / (math.exp(model.temperature / temperature) - 1.0)
    return max(model.modulus - drop, _LEAST * model.modulus)


@shear_modulus.of(LinearSoftening)
def _linear(model, J, pressure, temperature, melting_temperature):
    return model.modulus * max(1.0 - model.softening * temperature / melting_temperature, _LEAST)
