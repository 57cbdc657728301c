"""What the parts of an elastic-plastic law offer to the particle kernels; each part is a NamedTuple type of its own.

Functions are implementations for those types (see `numerics.dispatch.generic`), in plain arithmetic, of floats or of
four particles at once (`numerics.lanes.Lanes`). Pressure P = -tr(sigma)/3 is positive in compression; E [J/m^3] is the
internal energy per reference volume.
"""

import math

from parsolid.numerics.dispatch import generic
from parsolid.numerics.tensors import Tensor

# below this equivalent plastic strain rate [1/s] a flow stress counts as rate-independent
SLOWEST_RATE = 1e-12


@generic
def flow_stress(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    """Flow stress sigma_y [Pa] at an equivalent plastic strain and its rate [1/s]; 0 at and above the melting
    temperature.

    shear_modulus [Pa] and melting_temperature [K] are those of the current pressure and temperature.
    """


@generic
def shear_modulus(model, J, pressure, temperature, melting_temperature):
    """Shear modulus mu [Pa] at the Jacobian J = rho0/rho, the pressure [Pa] and the temperature [K]."""


@generic
def melting_temperature(model, J):
    """Melting temperature [K] at the Jacobian J = rho0/rho; infinite without a model (None)."""


@melting_temperature.of(None)
def _never(model, J):
    return math.inf


@generic
def cold_pressure(eos, J):
    """A(J) [Pa] of P = A(J) + gamma E."""


@generic
def grueneisen_coefficient(eos):
    """gamma of P = A(J) + gamma E, for all states (rho gamma is constant)."""


@generic
def isentropic_bulk_modulus(eos, J, pressure):
    """K_s = -J dP/dJ at constant entropy [Pa]."""


@generic
def room_to_compress(eos, J):
    """Positive while the equation of state holds at J."""


@generic
def deviator_update(
    flow, s: Tensor, strain: Tensor, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature
):
    """Unrotated deviator [Pa] after a step with the deviatoric strain increment `strain`, and the plastic flow in it.

    heating [K/(J/m^3)] of the plastic work. Returns (s, increment of the equivalent plastic strain, plastic work per
    volume).
    """


@generic
def plastic_increment(
    flow, trial, expected, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature
):
    """Increment x of the equivalent plastic strain with trial - 3 mu x = sigma_y(ep + x, x/step, T + heating sigma_y
    x).

    trial: von Mises stress [Pa] of the elastic trial state; expected: a guess of x, such as the step's equivalent
    strain; heating [K/(J/m^3)] of the plastic work. 0 where the trial is elastic.
    """
