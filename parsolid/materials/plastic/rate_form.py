"""The paper's rate form of plastic flow (Banerjee, section 1.3) with its signs mended, see docs/plasticity.md.

Explicit in time: consistency is differentiated, so that what a step overshoots the flow stress by is never taken back.
Flow is isochoric.
"""

import math
from typing import Any, NamedTuple

from parsolid.materials.plastic.plasticity import SLOWEST_RATE, deviator_update, flow_stress
from parsolid.numerics.elementary import choose
from parsolid.numerics.tensors import contract


class RateForm(NamedTuple):
    """A flow stress, advanced by the rate form instead of the radial return."""

    flow_stress: Any


# differences for the slopes of the flow stress over plastic strain and temperature [K]
_STRAIN, _TEMPERATURE = 1e-6, 1e-2


@deviator_update.of(RateForm)
def _advanced(flow, s, strain, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature):
    model, mu, melting = flow.flow_stress, shear_modulus, melting_temperature
    rate = max(math.sqrt(2.0 / 3.0 * contract(strain, strain)) / step, SLOWEST_RATE)
    stress = flow_stress(model, plastic_strain, rate, temperature, mu, melting)
    later = flow_stress(model, plastic_strain + _STRAIN, rate, temperature, mu, melting)
    warmer = flow_stress(model, plastic_strain, rate, temperature + _TEMPERATURE, mu, melting)
    # f = 3/2 s_s^2 - sigma_y^2 with s_s = |s|, f_s = xi = 3 s_s, f_p and f_t with the minus sign
    norm = math.sqrt(contract(s, s))
    f_s, f_p = 3.0 * norm, -2.0 * stress * (later - stress) / _STRAIN
    f_t = -2.0 * stress * (warmer - stress) / _TEMPERATURE
    along = contract(s, strain) / norm
    resistance = 2.0 * mu * f_s * f_s - math.sqrt(2.0 / 3.0) * f_p * f_s - f_t * heating * norm * f_s
    multiplier = max(2.0 * mu * f_s * along / resistance, 0.0)
    multiplier = choose(1.5 * norm * norm - stress * stress, multiplier, 0.0)
    new = s + 2.0 * mu * (strain + choose(multiplier, -3.0 * multiplier, 0.0) * s)
    increment = math.sqrt(2.0 / 3.0) * multiplier * f_s
    return new, increment, multiplier * f_s * norm
