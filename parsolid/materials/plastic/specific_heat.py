"""The specific heat of elastic-plastic solids, linear in the temperature, in kernels."""

import math

from decomposition.deferred import register_jitable


@register_jitable
def specific_heat(law, temperature):
    """C_v [J/(kg K)] at a temperature [K]."""
    return law.specific_heat + law.specific_heat_slope * (temperature - law.reference_temperature)


@register_jitable
def temperature_rise(law, capacity, heat):
    """x [K] of int C dT = heat [J/m^3] from a temperature where rho0 C_v is `capacity` [J/(m^3 K)] on."""
    grows = law.density * law.specific_heat_slope
    return 2.0 * heat / (capacity + math.sqrt(capacity * capacity + 2.0 * grows * heat))
