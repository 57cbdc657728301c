"""Shear moduli mu(P, T); none falls below a hundredth of its value at P = 0, T = 0, where the waves need some
stiffness.
"""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp, power
from parsolid.materials.declaration import ATOMIC_MASS_UNIT, OfMaterial, Parameter, law
from parsolid.materials.plastic.functions import shear_modulus

_LEAST = 0.01


@law("shear-modulus", "constant")
class ConstantShearModulus(NamedTuple):
    """modulus mu [Pa]."""

    modulus: Annotated[float, Parameter("Pa", "mu", above=0.0)]


@law("shear-modulus", "steinberg-cochran-guinan")
class SteinbergShearModulus(NamedTuple):
    """mu = mu0 [1 + A P J^(1/3) - B (T - 300)] (Steinberg, Cochran & Guinan 1980), 1/J = eta.

    modulus mu0 [Pa] at 300 K, pressure_coefficient A [1/Pa], temperature_coefficient B [1/K].
    """

    modulus: Annotated[float, Parameter("Pa", "mu0 at 300 K", above=0.0)]
    pressure_coefficient: Annotated[float, Parameter("1/Pa", "A", at_least=0.0)]
    temperature_coefficient: Annotated[float, Parameter("1/K", "B", at_least=0.0)]


@law("shear-modulus", "nadal-le-poac")
class NadalLePoac(NamedTuple):
    """mu of Nadal & Le Poac 2003, with a fall to zero at melting.

    modulus mu0 [Pa], pressure_coefficient d(mu)/dP / mu0 [1/Pa], width zeta, lindemann C, atomic_mass [kg], density
    [kg/m^3].
    """

    needs_melting = True  # type: ignore[misc]
    modulus: Annotated[float, Parameter("Pa", "mu0", above=0.0)]
    pressure_coefficient: Annotated[float, Parameter("1/Pa", "d(mu)/dP / mu0", at_least=0.0)]
    width: Annotated[float, Parameter("1", "zeta, of the fall to zero", above=0.0)]
    lindemann: Annotated[float, Parameter("1", "C", above=0.0)]
    atomic_mass: Annotated[float, Parameter("u", "the mass of an atom", above=0.0, factor=ATOMIC_MASS_UNIT)]
    density: Annotated[float, OfMaterial()]


@law("shear-modulus", "varshni")
class Varshni(NamedTuple):
    """mu = mu0 - D / (exp(T0/T) - 1) (Varshni 1970; Chen & Gray 1996): modulus mu0, drop D [Pa], temperature T0 [K]."""

    modulus: Annotated[float, Parameter("Pa", "mu0 at 0 K", above=0.0)]
    drop: Annotated[float, Parameter("Pa", "D", at_least=0.0)]
    temperature: Annotated[float, Parameter("K", "T0", above=0.0)]


@law("shear-modulus", "linear-softening")
class LinearSoftening(NamedTuple):
    """mu = G0 (1 - alpha T/T_m) (Preston, Tonks & Wallace 2003, eq (12)): modulus G0 [Pa], softening alpha."""

    needs_melting = True  # type: ignore[misc]
    modulus: Annotated[float, Parameter("Pa", "G0 at 0 K", above=0.0)]
    softening: Annotated[float, Parameter("1", "alpha", at_least=0.0, below=1.0)]


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
    fall = 1.0 + exp(-(1.0 + 1.0 / model.width) / (1.0 + model.width / (1.0 - homologous)))
    return max((cold + thermal) / fall, _LEAST * model.modulus)


@shear_modulus.of(Varshni)
def _varshni(model, J, pressure, temperature, melting_temperature):
    drop = model.drop / (exp(model.temperature / temperature) - 1.0)
    return max(model.modulus - drop, _LEAST * model.modulus)


@shear_modulus.of(LinearSoftening)
def _linear(model, J, pressure, temperature, melting_temperature):
    return model.modulus * max(1.0 - model.softening * temperature / melting_temperature, _LEAST)
