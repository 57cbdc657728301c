"""Flow stress of Preston, Tonks & Wallace (J. Appl. Phys. 93 (2003) 211) from thermal flow to overdriven shocks."""

import math
from typing import Annotated, NamedTuple

from parsolid.elementary import erf, exp, log, power
from parsolid.materials.declaration import ATOMIC_MASS_UNIT, OfMaterial, Parameter, law
from parsolid.materials.plastic.functions import flow_stress


@law("flow-stress", "preston-tonks-wallace")
class PrestonTonksWallace(NamedTuple):
    """sigma_y = 2 tau(ep, rate, T/T_m) mu; all parameters are numbers but atomic_mass [kg] and density [kg/m^3].

    hardening theta, hardening_exponent p, saturation_cold s_0, saturation_hot s_inf, activation kappa, rate_scale
    gamma, yield_cold y_0, yield_hot y_inf, medium_yield y_1, medium_exponent y_2, overdriven_exponent beta.
    """

    needs_melting = True  # type: ignore[misc]
    hardening: Annotated[float, Parameter("1", "theta", above=0.0)]
    hardening_exponent: Annotated[float, Parameter("1", "p", above=0.0)]
    saturation_cold: Annotated[float, Parameter("1", "s_0", above=0.0)]
    saturation_hot: Annotated[float, Parameter("1", "s_inf", above=0.0)]
    activation: Annotated[float, Parameter("1", "kappa", above=0.0)]
    rate_scale: Annotated[float, Parameter("1", "gamma", above=0.0)]
    yield_cold: Annotated[float, Parameter("1", "y_0", above=0.0)]
    yield_hot: Annotated[float, Parameter("1", "y_inf", above=0.0)]
    medium_yield: Annotated[float, Parameter("1", "y_1", above=0.0)]
    medium_exponent: Annotated[float, Parameter("1", "y_2", above=0.0)]
    overdriven_exponent: Annotated[float, Parameter("1", "beta", above=0.0)]
    atomic_mass: Annotated[float, Parameter("u", "the mass of an atom", above=0.0, factor=ATOMIC_MASS_UNIT)]
    density: Annotated[float, OfMaterial()]


@flow_stress.of(PrestonTonksWallace)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    # the time a transverse wave takes across an atom: xi = 1/2 (4 pi rho/3 M)^(1/3) sqrt(mu/rho)
    spacing = 0.5 * power(4.0 * math.pi * model.density / (3.0 * model.atomic_mass), 1.0 / 3.0)
    frequency = spacing * (shear_modulus / model.density) ** 0.5
    slow = log(model.rate_scale * frequency / rate)
    thermal = erf(model.activation * temperature / melting_temperature * slow)
    overdriven = model.saturation_cold * exp(-model.overdriven_exponent * slow)
    medium = min(model.medium_yield * exp(-model.medium_exponent * slow), overdriven)
    saturation = max(model.saturation_cold - (model.saturation_cold - model.saturation_hot) * thermal, overdriven)
    start = max(model.yield_cold - (model.yield_cold - model.yield_hot) * thermal, medium)
    # Voce hardening from `start` to `saturation`; past the cold saturation there is nothing left to harden
    room, p = max(model.saturation_cold - start, 1e-12), model.hardening_exponent
    b = max(p * (saturation - start) / room, 1e-12)
    growth = exp(b)
    strained = exp(-p * model.hardening * plastic_strain / (room * (growth - 1.0)))
    stress = saturation + room / p * log(1.0 - (1.0 - 1.0 / growth) * strained)
    return 2.0 * shear_modulus * stress if temperature < melting_temperature else 0.0
