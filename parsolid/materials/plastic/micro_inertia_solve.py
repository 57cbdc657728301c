"""One step of the micro-rate and the micro-stress at a particle: one monotone scalar equation, four particles at once.

With v = (1 - theta) v0 + theta v1 and what relaxes in a step, w = 1 - exp(-dt/t_pi), the equation for v1 >= 0 is

    rho l_m^2 (v1 - v0)/dt = div xi + (1 - theta) tau0 + theta s(v) - (1 - theta) pi0 - theta pi1
    s(v) = max(|S_tr| - 2 mu dt v, 0),  pi1 = pi0 + w (G(v) - pi0),  G = S_g R_1 R_2 v/d^p

(docs/microinertia.md). Its residual rises with v and is concave (for m_1 <= 1), so that Newton's method never passes
the root from the left, and lands left of it from the right. Halley's method is used first, which needs no other power:
G and its derivatives share one exp and one log.
"""

import math
from typing import Any, NamedTuple

from decomposition.deferred import register_jitable
from parsolid.materials.plastic.micro_inertia import (
    MicroInertia,
    flow_strength,
    inertia_per_volume,
    least_rate_square,
    relaxed_share,
)
from parsolid.numerics.dispatch import generic
from parsolid.numerics.elementary import choose, some_positive

# Halley's method is cubic: what a change of this leaves is below rounding
_SETTLED, _SETTLED_NEWTON = 1e-5, 1e-8
_HALLEY_STEPS, _MOST_STEPS = 8, 60
# theta = 1/2 rings where omega dt is greater than this
_IMPLICIT_FROM = 0.5


class MicroIncrements(NamedTuple):
    """What a step is the same of for all particles: step [s], theta, d_0^-m_1, and what relaxes, 1 - exp(-dt/t), of
    micro-stress, micro-flux and heat flux (None without a time).
    """

    step: float
    theta: float
    rate_factor: float
    relax_stress: float | None
    relax_flux: float | None
    relax_heat: float | None


@generic
def increments_of(law: Any, step: float) -> MicroIncrements:
    """`MicroIncrements` of a step [s]: theta = 1/2 is of second order, 1 where sqrt(2 mu/(rho l_m^2)) dt > 0.5."""


@increments_of.of(MicroInertia)
def _increments(law, step):
    theta, length = 1.0, law.inertia_length
    if length is not None:
        frequency = math.sqrt(2.0 * law.shear_modulus / law.density) / length
        theta = 1.0 if frequency * step > _IMPLICIT_FROM else 0.5
    times = (law.stress_relaxation_time, law.flux_relaxation_time, law.heat_relaxation_time)
    relax = (None if time is None else -math.expm1(-step / time) for time in times)
    return MicroIncrements(float(step), theta, law.reference_rate**-law.rate_exponent, *relax)


@generic
def advance_micro(law, increments, density, tau, trial, rate, stress, gamma, curl, temperature, force, gradient_square):
    """Micro-rate and micro-stress of particles after a step: (v1, v, tau1, pi1, heat, lost).

    At the start of the step: density rho (the present one) [kg/m^3], tau = |S|, rate v^p [1/s], stress pi [Pa], gamma,
    curl eta^p [1/m] (None without hardening_length), temperature [K], force div xi [Pa] (None without energetic and
    dissipative length), gradient_square |grad v^p|^2 (None without dissipative_length); trial: |S_tr| [Pa] of the
    elastic step. v: the mean rate, gamma grows by v dt; tau1: |S| at the end; heat: pi v dt [J/m^3]; lost: what theta
    = 1 and the constraints v^p >= 0, |S| >= 0 take away [J/m^3]. NaN gives NaN.
    """


@register_jitable
def _value(force, like):
    if force is None:
        return 0.0 * like
    return 1.0 * force


@register_jitable
def _frictionless(length, inertia, softness, weight, rate, drive, trial):
    """The root without G: an upper bound, nearly the root where the micro-stress changes little in a step."""
    coupled = (inertia * rate + weight * (drive + trial)) / (inertia + weight * softness + 1e-300)
    if length is None:
        return coupled
    # beyond |S| = 0 inertia alone is left; the residual is the less of two lines, its root the greater of two
    free = rate + weight * drive / inertia
    return choose(free - coupled, free, coupled)


@register_jitable
def _micro_stress(rate, least, exponent):
    """v d^(m_1 - 1), d^2 = v^2 + least, and its first and second derivative."""
    square = rate * rate
    inverse = 1.0 / (square + least)
    factor = math.exp((0.5 * (exponent - 1.0)) * math.log(square + least))
    value = rate * factor
    slope = factor * inverse * (least + exponent * square)
    return value, slope, (exponent - 1.0) * value * inverse * inverse * (3.0 * least + exponent * square)


@register_jitable
def _candidate(iteration, x, low, high, residual, slope, curvature):
    """The next rate, within the bracket."""
    change = residual / slope
    new = x - change
    if iteration < _HALLEY_STEPS:
        bend = 1.0 - 0.5 * change * curvature / slope
        far = x - change / choose(0.25 - bend, 0.25, bend)
        new = choose(far - high, new, far)
    # by rounding alone is Newton's rate beyond the upper bound
    new = choose(new - high, high, new)
    return choose(low - new, low, new)


@register_jitable
def _mean_rate(law, theta, inertia, softness, weight, power_weight, rate, drive, trial, least):
    """The root v >= (1 - theta) v0, and v d^(m_1 - 1) of it.

    Of inertia (v - v0) - weight (drive + s(v)) + power_weight v d^(m_1 - 1) = 0; a particle that has settled is not
    changed by others beside it.
    """
    low = (1.0 - theta) * rate
    high = _frictionless(law.inertia_length, inertia, softness, weight, rate, drive, trial)
    high = choose(low - high, low, high)
    # without much inertia the last rate is nearer
    x = high
    if theta == 1.0:
        x = choose(high - rate, rate, high)
    emptied = trial / (softness + 1e-300)
    active, result = 0.0 * high + 1.0, 0.0 * high
    for iteration in range(_MOST_STEPS):
        value, slope, curvature = _micro_stress(x, least, law.rate_exponent)
        left = trial - softness * x
        left = choose(-left, 0.0 * left, left)
        residual = inertia * (x - rate) - weight * (drive + left) + power_weight * value
        steepness = inertia + power_weight * slope + choose(left, weight * softness, 0.0)
        low, high = choose(residual, low, x), choose(residual, x, high)
        # a floor for where nothing resists, too low to be felt elsewhere
        steepness = steepness + 1e-12 * weight * softness + 1e-300
        new = _candidate(iteration, x, low, high, residual, steepness, power_weight * curvature)
        change = new - x
        result = choose(active, value + change * (slope + 0.5 * change * curvature), result)
        # a step over the corner of s(v) is not yet the last
        crossed = choose((emptied - x) * (new - emptied), 1.0, 0.0)
        settled = (_SETTLED if iteration < _HALLEY_STEPS else _SETTLED_NEWTON) * new
        x = choose(active, new, x)
        unsettled = choose(max(change, -change) - settled, 1.0, crossed)
        active = choose(active, unsettled, active)
        if not some_positive(active):
            break
    return x, result


@register_jitable
def _settled_stress(length, relax, stress, share, reached, tau):
    """pi1; without inertia and relaxation it is |S|, of which the equation makes it the equal."""
    if length is None and relax is None:
        return 1.0 * tau
    return stress + share * (reached - stress)


@advance_micro.of(MicroInertia)
def _advance(law, increments, density, tau, trial, rate, stress, gamma, curl, temperature, force, gradient_square):
    step, theta = increments.step, increments.theta
    # in the middle of the step, from the old rate
    warm = temperature + 0.5 * step * stress * rate / (density * law.specific_heat)
    strength = flow_strength(law, gamma + 0.5 * step * rate, curl, warm) * increments.rate_factor
    least = least_rate_square(law, rate, gradient_square)
    share, pushed = relaxed_share(increments.relax_stress), _value(force, rate)
    inertia = inertia_per_volume(law.inertia_length, density)
    softness, weight = 2.0 * law.shear_modulus * step, step * theta
    # (the force, what is left of pi0, and (1 - theta) tau0) over theta, so that one weight stands before all
    drive = (pushed + (1.0 - theta) * tau - (1.0 - theta * share) * stress) / theta
    mean, power_law = _mean_rate(
        law, theta, inertia, softness, weight * theta, weight * theta * share * strength, rate, drive, trial, least
    )
    left = trial - softness * mean
    tau1 = choose(-left, 0.0 * left, left)
    rate1 = (mean - (1.0 - theta) * rate) / theta
    reached = strength * power_law
    stress1 = _settled_stress(law.inertia_length, increments.relax_stress, stress, share, reached, tau1)
    flow = mean * step
    heat = ((1.0 - theta) * stress + theta * stress1) * flow
    work = (pushed + 0.5 * (tau + tau1)) * flow
    lost = work - heat - 0.5 * inertia * (rate1 * rate1 - rate * rate)
    return rate1, mean, tau1, stress1, heat, lost
