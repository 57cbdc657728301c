"""Radial return: a trial deviator scaled back onto the flow stress, by one scalar equation a particle, four at once."""

import math

from decomposition.deferred import register_jitable
from parsolid.materials.plastic import lanes_laws  # noqa: F401
from parsolid.materials.plastic.plasticity import SLOWEST_RATE, deviator_update, flow_stress, plastic_increment
from parsolid.numerics.elementary import choose, some_positive
from parsolid.numerics.tensors import contract

_MOST_STEPS = 80
# the residual of the return over the trial stress
_TOLERANCE = 1e-10


@register_jitable
def _residual(flow, x, trial, plastic_strain, step, temperature, heating, mu, melting):
    """Stress of the return less flow stress [Pa]; falls with x."""
    returned = trial - 3.0 * mu * x
    rate = max(x / step, SLOWEST_RATE)
    return returned - flow_stress(flow, plastic_strain + x, rate, temperature + heating * returned * x, mu, melting)


@plastic_increment.otherwise
def _guarded(flow, trial, expected, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature):
    # Newton's method with the slope through the last two points, and bisection where it leaves the bracket
    zero = 0.0 * trial
    arguments = (trial, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature)
    excess = _residual(flow, zero, *arguments)
    if not some_positive(excess):
        return zero
    slope = zero - 3.0 * shear_modulus
    low, high = zero, -trial / slope
    old, old_residual = zero, zero
    x, active = choose(excess, min(expected, 0.999 * high), zero), excess
    for iteration in range(_MOST_STEPS):
        residual = _residual(flow, x, *arguments)
        active = choose(active, max(residual, -residual) - _TOLERANCE * trial, active)
        if not some_positive(active):
            break
        low, high = choose(residual, x, low), choose(residual, high, x)
        if iteration > 0:
            # not through x = 0, where a flow stress in ln(rate) is steep; rounding can spoil it between close points
            new_slope = (residual - old_residual) / (x - old)
            slope = choose(-new_slope, new_slope, slope)
        new = x - residual / slope
        inside = choose(new - low, high - new, zero)
        if iteration > 12 and iteration % 2 == 0:
            inside = zero
        new = choose(inside, new, 0.5 * (low + high))
        old, old_residual = x, residual
        x = choose(active, new, x)
    return x


@deviator_update.otherwise
def _returned(flow, s, strain, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature):
    trial = s + 2.0 * shear_modulus * strain
    mises = math.sqrt(1.5 * contract(trial, trial))
    if step == 0.0:
        # no time to flow in: a stress above that of slow flow stays
        return trial, 0.0 * mises, 0.0 * mises
    # in steady flow the whole strain of the step is plastic
    expected = math.sqrt(2.0 / 3.0 * contract(strain, strain))
    increment = plastic_increment(
        flow, mises, expected, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature
    )
    stress = mises - 3.0 * shear_modulus * increment
    return choose(increment, stress / mises, 1.0) * trial, increment, stress * increment
