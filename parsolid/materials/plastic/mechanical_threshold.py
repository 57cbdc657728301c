"""Mechanical threshold stress (Follansbee & Kocks, Acta Metall. 36 (1988) 81; Chen & Gray, Metall. Trans. A 27 (1996)
2994).
"""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp, log, power
from parsolid.kernels import inlined
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import flow_stress


@law("flow-stress", "mechanical-threshold")
class MechanicalThreshold(NamedTuple):
    """sigma_y = sigma_a + S(rate, T) sigma_e(ep) mu/mu0; the threshold stress sigma_e hardens at a fixed rate and
    temperature.

    S = [1 - (k T/(g0 mu b^3) ln(edot0/rate))^(1/q)]^(1/p);
    d sigma_e/d ep = theta (1 - tanh(alpha x)/tanh alpha), x = sigma_e/sigma_es;
    theta = a0 + a1 ln rate + a2 sqrt(rate) - a3 T;
    ln(sigma_es/sigma_es0) = k T/(g0s mu b^3) ln(rate/edot_s).
    Stresses and a0..a2 [Pa], a3 [Pa/K], boltzmann_over_burgers k/b^3 [Pa/K], rates [1/s]. mu scales the thermal part
    alone.
    """

    athermal_stress: Annotated[float, Parameter("Pa", "sigma_a", at_least=0.0)]
    shear_modulus: Annotated[float, Parameter("Pa", "mu0", above=0.0)]
    boltzmann_over_burgers: Annotated[float, Parameter("Pa/K", "k/b^3", above=0.0)]
    activation: Annotated[float, Parameter("1", "g0", above=0.0)]
    activation_rate: Annotated[float, Parameter("1/s", "edot0", above=0.0)]
    p: Annotated[float, Parameter("1", "exponent of the glide barrier, inner", above=0.0)]
    q: Annotated[float, Parameter("1", "exponent of the glide barrier, outer", above=0.0)]
    hardening: Annotated[float, Parameter("Pa", "a0", above=0.0)]
    hardening_log_rate: Annotated[float, Parameter("Pa", "a1", default=0.0)]
    hardening_root_rate: Annotated[float, Parameter("Pa", "a2", default=0.0)]
    hardening_temperature: Annotated[float, Parameter("Pa/K", "a3", default=0.0)]
    alpha: Annotated[float, Parameter("1", "factor within the tanh of hardening", above=0.0)]
    saturation_stress: Annotated[float, Parameter("Pa", "sigma_es0", above=0.0)]
    saturation_activation: Annotated[float, Parameter("1", "g0s", above=0.0)]
    saturation_rate: Annotated[float, Parameter("1/s", "edot_s", above=0.0)]


@inlined
def _halley_step(logarithm, slope, c):
    """The next ln w towards ln sinh w - slope w = c."""
    w = exp(logarithm)
    decay = exp(-2.0 * w)
    # where the difference has no digits left, sinh w = w
    short = w < 1e-5
    twice = 2.0 * w if short else 1.0 - decay
    log_sinh = w + log(0.5 * twice)
    value = (logarithm if short else log_sinh) - slope * w - c
    rise = w * ((1.0 + decay) / twice - slope)
    bend = rise - 4.0 * (w / twice) * (w / twice) * decay
    return logarithm - value * rise / (rise * rise - 0.5 * value * bend)


@inlined
def _hardened(alpha, strain):
    """x with int_0^x dx'/(1 - tanh(alpha x')/tanh alpha) = strain, by Halley's method.

    The integral in closed form with w = alpha (1 - x): ln sinh w - w tanh alpha = c. The unknown is ln w, in which the
    left side is nearly straight while w is small; the start is right at both ends.
    """
    grown = exp(alpha)
    sinh, cosh = 0.5 * (grown - 1.0 / grown), 0.5 * (grown + 1.0 / grown)
    slope = sinh / cosh
    c = log(sinh) - alpha * slope - alpha / (sinh * cosh) * strain
    full, first = sinh * exp(-alpha * slope), exp(c)
    near = first / full
    w = first / (1.0 - slope * first - (1.0 - full / alpha - slope * full) * (near * near * near))
    # to round-off for alpha up to 6; written out, because a loop within one over particles is not vectorised
    x = _halley_step(log(w), slope, c)
    x = _halley_step(x, slope, c)
    x = _halley_step(x, slope, c)
    x = _halley_step(x, slope, c)
    x = _halley_step(x, slope, c)
    x = _halley_step(x, slope, c)
    return 1.0 - exp(x) / alpha


@flow_stress.of(MechanicalThreshold)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    thermal = model.boltzmann_over_burgers * temperature / shear_modulus
    speed = log(rate)
    barrier = thermal / model.activation * max(log(model.activation_rate) - speed, 0.0)
    share = power(1.0 - min(power(barrier, 1.0 / model.q), 1.0), 1.0 / model.p)
    theta = model.hardening + model.hardening_log_rate * speed + model.hardening_root_rate * rate**0.5
    # far below its range of rates the fit of theta is negative
    theta = max(theta - model.hardening_temperature * temperature, 0.0)
    rise = thermal / model.saturation_activation * (speed - log(model.saturation_rate))
    saturation = model.saturation_stress * exp(rise)
    threshold = saturation * _hardened(model.alpha, theta * plastic_strain / saturation)
    solid = model.athermal_stress + share * threshold * shear_modulus / model.shear_modulus
    return solid if temperature < melting_temperature else 0.0
