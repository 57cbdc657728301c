"""Functions of plastic laws on four particles at once, for methods that have not moved to `functions`."""

import math

from decomposition.deferred import register_jitable
from parsolid.materials.plastic.equation_of_state import LinearElastic, MieGrueneisen
from parsolid.materials.plastic.johnson_cook import JohnsonCook
from parsolid.materials.plastic.linear_hardening import LinearHardening
from parsolid.materials.plastic.mechanical_threshold import MechanicalThreshold
from parsolid.materials.plastic.melting import ConstantMelting, SteinbergMelting
from parsolid.materials.plastic.plasticity import (
    cold_pressure,
    flow_stress,
    grueneisen_coefficient,
    isentropic_bulk_modulus,
    melting_temperature,
    plastic_increment,
    room_to_compress,
    shear_modulus,
)
from parsolid.materials.plastic.preston_tonks_wallace import PrestonTonksWallace
from parsolid.materials.plastic.shear_modulus import (
    ConstantShearModulus,
    LinearSoftening,
    NadalLePoac,
    SteinbergShearModulus,
    Varshni,
)
from parsolid.materials.plastic.steinberg_cochran_guinan import SteinbergCochranGuinan, ThermalActivation
from parsolid.materials.plastic.zerilli_armstrong import ZerilliArmstrong
from parsolid.numerics.dispatch import generic
from parsolid.numerics.elementary import choose, power, some_positive

_LEAST = 0.01
_BOLTZMANN = 1.380649e-23


@cold_pressure.of(MieGrueneisen)
def _hugoniot_equation_of_state(eos, J):
    # P = P_H (1 - gamma x/2) + gamma E, P_H = rho0 C0^2 x/(1 - S x)^2, x = 1 - J
    x = 1.0 - J
    root = eos.sound_speed / (1.0 - eos.slope * x)
    return eos.density * root * root * x * (1.0 - 0.5 * eos.gamma * x)


@grueneisen_coefficient.of(MieGrueneisen)
def _gamma_equation_of_state(eos):
    return eos.gamma


@isentropic_bulk_modulus.of(MieGrueneisen)
def _bulk_equation_of_state(eos, J, pressure):
    # K = -J dP/dJ at constant E; along the isentrope dE = -P dJ
    x = 1.0 - J
    r = 1.0 / (1.0 - eos.slope * x)
    cold = eos.density * eos.sound_speed * eos.sound_speed * (1.0 + (eos.slope - eos.gamma) * x) * (r * r * r)
    return J * (cold + eos.gamma * pressure)


@room_to_compress.of(MieGrueneisen)
def _room_equation_of_state(eos, J):
    # at S (1 - J) = 1 the Hugoniot has no pressure left that is finite
    return min(J, 1.0 - eos.slope * (1.0 - J))


@cold_pressure.of(LinearElastic)
def _linear_equation_of_state(eos, J):
    return -eos.bulk_modulus * math.log(J)


@grueneisen_coefficient.of(LinearElastic)
def _no_heat_equation_of_state(eos):
    return 0.0


@isentropic_bulk_modulus.of(LinearElastic)
def _linear_bulk_equation_of_state(eos, J, pressure):
    return eos.bulk_modulus


@room_to_compress.of(LinearElastic)
def _any_room_equation_of_state(eos, J):
    return J


@flow_stress.of(JohnsonCook)
def _flow_johnson_cook(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    hardened = model.yield_stress + model.hardening * power(plastic_strain, model.exponent)
    fast = 1.0 + model.rate_sensitivity * math.log(max(rate / model.reference_rate, 1.0))
    warm = (temperature - model.reference_temperature) / (melting_temperature - model.reference_temperature)
    softened = 1.0 - power(max(warm, 0.0), model.thermal_exponent)
    return choose(melting_temperature - temperature, hardened * fast * softened, 0.0)


@flow_stress.of(LinearHardening)
def _flow_linear_hardening(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    solid = model.yield_stress + model.hardening * plastic_strain
    return choose(melting_temperature - temperature, solid, 0.0)


@plastic_increment.of(LinearHardening)
def _closed_form_linear_hardening(
    flow, trial, expected, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature
):
    yielding = flow_stress(flow, plastic_strain, step, temperature, shear_modulus, melting_temperature)
    slope = choose(melting_temperature - temperature, flow.hardening, 0.0)
    return max((trial - yielding) / (3.0 * shear_modulus + slope), 0.0)


@register_jitable
def _hardened_mechanical_threshold(alpha, strain):
    """x with int_0^x dx'/(1 - tanh(alpha x')/tanh alpha) = strain, by Halley's method.

    The integral in closed form with w = alpha (1 - x): ln sinh w - w tanh alpha = c. The unknown is ln w, in which the
    left side is nearly straight while w is small; the start is right at both ends.
    """
    slope = math.tanh(alpha)
    c = math.log(math.sinh(alpha)) - alpha * slope - alpha / (math.sinh(alpha) * math.cosh(alpha)) * strain
    full, first = math.sinh(alpha) * math.exp(-alpha * slope), math.exp(c)
    near = first / full
    w = first / (1.0 - slope * first - (1.0 - full / alpha - slope * full) * (near * near * near))
    logarithm, moving = math.log(w), 1.0 + 0.0 * c
    for _ in range(20):
        w = math.exp(logarithm)
        decay = math.exp(-2.0 * w)
        # where the difference has no digits left, sinh w = w
        short = w - 1e-5
        twice = choose(short, 1.0 - decay, 2.0 * w)
        value = choose(short, w + math.log(0.5 * twice), logarithm) - slope * w - c
        rise = w * ((1.0 + decay) / twice - slope)
        bend = rise - 4.0 * w * w * decay / (twice * twice)
        change = choose(moving, value * rise / (rise * rise - 0.5 * value * bend), 0.0)
        logarithm = logarithm - change
        # the error falls with its cube
        moving = choose(moving, max(change, -change) - 1e-5, moving)
        if not some_positive(moving):
            break
    return 1.0 - math.exp(logarithm) / alpha


@flow_stress.of(MechanicalThreshold)
def _flow_mechanical_threshold(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    thermal = model.boltzmann_over_burgers * temperature / shear_modulus
    speed = math.log(rate)
    barrier = thermal / model.activation * max(math.log(model.activation_rate) - speed, 0.0)
    share = power(1.0 - min(power(barrier, 1.0 / model.q), 1.0), 1.0 / model.p)
    theta = model.hardening + model.hardening_log_rate * speed + model.hardening_root_rate * math.sqrt(rate)
    # far below its range of rates the fit of theta is negative
    theta = max(theta - model.hardening_temperature * temperature, 0.0)
    saturation = model.saturation_stress * math.exp(
        thermal / model.saturation_activation * (speed - math.log(model.saturation_rate))
    )
    threshold = saturation * _hardened_mechanical_threshold(model.alpha, theta * plastic_strain / saturation)
    solid = model.athermal_stress + share * threshold * shear_modulus / model.shear_modulus
    return choose(melting_temperature - temperature, solid, 0.0)


@melting_temperature.of(ConstantMelting)
def _constant_melting(model, J):
    return model.temperature


@melting_temperature.of(SteinbergMelting)
def _steinberg_melting(model, J):
    exponent = 2.0 * (model.gamma - model.volume_coefficient - 1.0 / 3.0)
    # eta^b = exp(-b ln J)
    return model.temperature * math.exp(2.0 * model.volume_coefficient * (1.0 - J) - exponent * math.log(J))


@flow_stress.of(PrestonTonksWallace)
def _flow_preston_tonks_wallace(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    # the time a transverse wave takes across an atom: xi = 1/2 (4 pi rho/3 M)^(1/3) sqrt(mu/rho)
    spacing = 0.5 * (4.0 * math.pi * model.density / (3.0 * model.atomic_mass)) ** (1.0 / 3.0)
    frequency = spacing * math.sqrt(shear_modulus / model.density)
    slow = math.log(model.rate_scale * frequency / rate)
    thermal = math.erf(model.activation * temperature / melting_temperature * slow)
    overdriven = model.saturation_cold * math.exp(-model.overdriven_exponent * slow)
    medium = min(model.medium_yield * math.exp(-model.medium_exponent * slow), overdriven)
    saturation = max(model.saturation_cold - (model.saturation_cold - model.saturation_hot) * thermal, overdriven)
    start = max(model.yield_cold - (model.yield_cold - model.yield_hot) * thermal, medium)
    # Voce hardening from `start` to `saturation`; past the cold saturation there is nothing left to harden
    room, p = max(model.saturation_cold - start, 1e-12), model.hardening_exponent
    b = max(p * (saturation - start) / room, 1e-12)
    growth = math.exp(b)
    strained = math.exp(-p * model.hardening * plastic_strain / (room * (growth - 1.0)))
    stress = saturation + room / p * math.log(1.0 - (1.0 - 1.0 / growth) * strained)
    return choose(melting_temperature - temperature, 2.0 * shear_modulus * stress, 0.0)


@shear_modulus.of(ConstantShearModulus)
def _constant_shear_modulus(model, J, pressure, temperature, melting_temperature):
    return model.modulus


@shear_modulus.of(SteinbergShearModulus)
def _steinberg_shear_modulus(model, J, pressure, temperature, melting_temperature):
    hardened = 1.0 + model.pressure_coefficient * pressure * power(J, 1.0 / 3.0)
    return model.modulus * max(hardened - model.temperature_coefficient * (temperature - 300.0), _LEAST)


@shear_modulus.of(NadalLePoac)
def _nadal_le_poac_shear_modulus(model, J, pressure, temperature, melting_temperature):
    homologous = min(temperature / melting_temperature, 1.0 - 1e-9)
    cold = model.modulus * (1.0 + model.pressure_coefficient * pressure * power(J, 1.0 / 3.0)) * (1.0 - homologous)
    thermal = model.density / (J * model.lindemann * model.atomic_mass) * _BOLTZMANN * temperature
    fall = 1.0 + math.exp(-(1.0 + 1.0 / model.width) / (1.0 + model.width / (1.0 - homologous)))
    return max((cold + thermal) / fall, _LEAST * model.modulus)


@shear_modulus.of(Varshni)
def _varshni_shear_modulus(model, J, pressure, temperature, melting_temperature):
    drop = model.drop / (math.exp(model.temperature / temperature) - 1.0)
    return max(model.modulus - drop, _LEAST * model.modulus)


@shear_modulus.of(LinearSoftening)
def _linear_shear_modulus(model, J, pressure, temperature, melting_temperature):
    return model.modulus * max(1.0 - model.softening * temperature / melting_temperature, _LEAST)


@generic
def _thermal_stress_steinberg_cochran_guinan(activation, rate, temperature):
    """Y_T [Pa]."""


@_thermal_stress_steinberg_cochran_guinan.of(None)
def _none_steinberg_cochran_guinan(activation, rate, temperature):
    return 0.0


@_thermal_stress_steinberg_cochran_guinan.of(ThermalActivation)
def _bisected_steinberg_cochran_guinan(activation, rate, temperature):
    # the rate rises with Y_T: bisection of y = Y_T/Y_P in [0, 1], to 1e-13 of Y_P
    low, high, barrier = (
        0.0 * temperature,
        1.0 + 0.0 * temperature,
        2.0 * activation.kink_energy / (_BOLTZMANN * temperature),
    )
    for _ in range(44):
        y = 0.5 * (low + high)
        waiting = math.exp(barrier * (1.0 - y) * (1.0 - y)) / activation.frequency
        slow = rate * (waiting + activation.drag / (y * activation.peierls_stress)) - 1.0
        low, high = choose(slow, y, low), choose(slow, high, y)
    return activation.peierls_stress * low


@flow_stress.of(SteinbergCochranGuinan)
def _flow_steinberg_cochran_guinan(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    hardened = power(1.0 + model.hardening * (plastic_strain + model.initial_strain), model.exponent)
    athermal = min(model.yield_stress * hardened, model.greatest_yield_stress)
    solid = (
        (athermal + _thermal_stress_steinberg_cochran_guinan(model.activation, rate, temperature))
        * shear_modulus
        / model.shear_modulus
    )
    return choose(melting_temperature - temperature, solid, 0.0)


@flow_stress.of(ZerilliArmstrong)
def _flow_zerilli_armstrong(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    activation = temperature * (model.rate_sensitivity * math.log(rate) - model.softening)
    solid = model.athermal_stress + model.hardening * math.sqrt(plastic_strain) * math.exp(activation)
    return choose(melting_temperature - temperature, solid, 0.0)
