"""What the parts of an elastic-plastic law offer; each part is a NamedTuple type of its own.

Functions are plain arithmetic on numbers. They are run over many particles at once: where a value depends on a
condition, write `a if condition else b`, and take exp, log and power from `parsolid.elementary`, so that loops over
particles are vectorised. The pressure P = -tr(sigma)/3 is positive in compression; E [J/m^3] is the internal energy per
reference volume; J = rho0/rho.
"""

import math

from parsolid.kernels import inlined
from parsolid.materials.law_functions import law_function
from parsolid.materials.plastic.heat_capacity import capacity_at, rise_by_heat

# below this equivalent plastic strain rate [1/s] a flow stress counts as rate-independent
SLOWEST_RATE = 1e-12


@law_function
def flow_stress(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    """Flow stress sigma_y [Pa] at an equivalent plastic strain and its rate [1/s]; 0 at and above the melting
    temperature.

    shear_modulus [Pa] and melting_temperature [K] are those of the current pressure and temperature.
    """


@law_function
def shear_modulus(model, J, pressure, temperature, melting_temperature):
    """Shear modulus mu [Pa] at the Jacobian J, the pressure [Pa] and the temperature [K]."""


@law_function
def melting_temperature(model, J):
    """Melting temperature [K] at the Jacobian J; infinite without a model (None)."""


@melting_temperature.of(None)
def _never(model, J):
    return math.inf


@law_function
def cold_pressure(eos, J):
    """A(J) [Pa] of P = A(J) + gamma E."""


@law_function
def grueneisen_coefficient(eos):
    """gamma of P = A(J) + gamma E, for all states (rho gamma is constant)."""


@law_function
def isentropic_bulk_modulus(eos, J, pressure):
    """K_s = -J dP/dJ at constant entropy [Pa]."""


@law_function
def room_to_compress(eos, J):
    """Positive while the equation of state holds at J."""


@law_function
def elastic_jacobian(flow, J, volume):
    """The elastic part of the Jacobian J; volume: the plastic logarithmic strain of volume, of flow stresses whose flow
    changes the volume."""


@elastic_jacobian.otherwise
def _isochoric_flow(flow, J, volume):
    return J


@law_function
def stress_measure(flow, J):
    """(a, b) of sigma = a (2 mu d - A 1) + b mu d:d 1 in methods with deformation gradients, d the logarithmic elastic
    deviator: (1/J, 0) where 2 mu d - A 1 is Kirchhoff's stress, whose energy is mu d:d - int A d ln J."""


@stress_measure.otherwise
def _of_cauchy_stress(flow, J):
    return 1.0, 1.0


@law_function
def back_stress_step(hardening, increment):
    """(kept, modulus [Pa]): a back stress beta becomes kept (beta + 2/3 modulus dp) in a step with the plastic strain
    dp, whose equivalent is the increment. kept falls and kept modulus does not grow with it, and both are 1 and the
    modulus at 0."""


@law_function
def back_stress_energy(hardening, square):
    """Energy [J/m^3] that a back stress stores, from beta:beta [Pa^2]."""


@inlined
def specific_heat(law, temperature):
    """C_v [J/(kg K)] of an elastic-plastic law at a temperature [K]."""
    return capacity_at(law.heat_points, law, temperature)


@inlined
def temperature_rise(law, temperature, heat):
    """x [K] of int rho0 C_v dT = heat [J/m^3] from a temperature [K] on."""
    return rise_by_heat(law.heat_points, law, temperature, heat)


@inlined
def wave_speed(law, J, pressure, shear_modulus):
    """c = sqrt((K_s + 4/3 mu)/rho) [m/s] of pressure waves at the Jacobian J, the pressure and the shear modulus [Pa].

    Where tension makes the volume unstable the shear stiffness alone counts.
    """
    bulk = max(isentropic_bulk_modulus(law.equation_of_state, J, pressure), 0.0)
    return ((bulk + 4.0 / 3.0 * shear_modulus) * J / law.density) ** 0.5
