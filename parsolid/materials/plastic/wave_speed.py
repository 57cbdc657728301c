"""Speed of pressure waves in an elastic-plastic solid."""

import math

from decomposition.deferred import register_jitable
from parsolid.materials.plastic.plasticity import isentropic_bulk_modulus


@register_jitable
def wave_speed(law, J, pressure, shear_modulus):
    """c = sqrt((K_s + 4/3 mu)/rho) [m/s] at the Jacobian J, the pressure and the shear modulus [Pa].

    Where tension makes the volume unstable the shear stiffness alone counts.
    """
    bulk = max(isentropic_bulk_modulus(law.equation_of_state, J, pressure), 0.0)
    return math.sqrt((bulk + 4.0 / 3.0 * shear_modulus) * J / law.density)
