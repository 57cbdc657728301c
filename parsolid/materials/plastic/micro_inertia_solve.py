"""One step of the micro-rate and the micro-stress: one monotone scalar equation a particle, on tiles of 32 particles.

With v = (1 - theta) v0 + theta v1 and what relaxes in a step, w = 1 - exp(-dt/t_pi), the equation for v1 >= 0 is

    rho l_m^2 (v1 - v0)/dt = div xi + (1 - theta) tau0 + theta s(v) - (1 - theta) pi0 - theta pi1
    s(v) = max(|S_tr| - 2 mu dt v, 0),  pi1 = pi0 + w (G(v) - pi0),  G = S_g R_1 R_2 v/d^p

(docs/ulsph.md). Its residual rises with v and is concave (for m_1 <= 1), so that Newton's method never passes
the root from the left, and lands left of it from the right. Halley's method is used first, which needs no other power:
G and its derivatives share one exp and one log.

`new_tile` makes a tile (`parsolid.tiles`), whose first 12 rows are the method's: DEVIATOR and STRAIN of `tile_update`.
The method fills of the start of the step

    DENSITY (the present one) [kg/m^3], TAU |S|, TRIAL |S_tr| of the elastic step, RATE v^p [1/s], STRESS pi [Pa],
    GAMMA, CURL eta^p [1/m], TEMPERATURE [K], FORCE div xi [Pa], GRADIENT_SQUARE |grad v^p|^2 [1/(m s)^2]

and `advance_micro` adds NEW_RATE, MEAN_RATE (gamma grows by it times dt), NEW_TAU |S| and NEW_STRESS of the end, HEAT
pi v dt [J/m^3], and LOST [J/m^3]: what theta = 1 and the constraints v^p >= 0, |S| >= 0 take away. NaN gives NaN.
"""

import math

import numpy as np

from parsolid.elementary import exp, log
from parsolid.kernels import inlined, kernel
from parsolid.materials.plastic.micro_inertia import MicroIncrements, flow_strength, least_rate_square
from parsolid.tiles import TILE

DENSITY, TAU, TRIAL, RATE, STRESS, GAMMA, CURL, TEMPERATURE, FORCE, GRADIENT_SQUARE = range(12, 22)
NEW_RATE, MEAN_RATE, NEW_TAU, NEW_STRESS, HEAT, LOST = range(22, 28)
_LOW, _HIGH, _DRIVE, _STRENGTH, _LEAST, _RESULT, _MOVES = range(28, 35)
ROWS = 35
# Halley's method is cubic: what a change of this leaves is below rounding
_SETTLED, _SETTLED_NEWTON = 1e-5, 1e-8
_HALLEY_STEPS, _MOST_STEPS = 8, 60
# theta = 1/2 rings where omega dt is greater than this
_IMPLICIT_FROM = 0.5


def increments_of(law, step: float) -> MicroIncrements:
    """`MicroIncrements` of a step [s]: theta = 1/2 is of second order, 1 where sqrt(2 mu/(rho l_m^2)) dt > 0.5."""
    theta = 1.0
    if law.inertia_length:
        frequency = math.sqrt(2.0 * law.shear_modulus / law.density) / law.inertia_length
        theta = 1.0 if frequency * step > _IMPLICIT_FROM else 0.5
    times = (law.stress_relaxation_time, law.flux_relaxation_time, law.heat_relaxation_time)
    shares = (-math.expm1(-step / time) if time else 1.0 for time in times)
    return MicroIncrements(float(step), theta, law.reference_rate**-law.rate_exponent, *shares)


def new_tile(rows: int = ROWS) -> np.ndarray:
    """A tile at rest; rows: with those that a method adds, which are 1."""
    tile = np.zeros((rows, TILE))
    tile[[DENSITY, TEMPERATURE]], tile[ROWS:] = 1.0, 1.0
    return tile.ravel()


@inlined
def _micro_stress(rate, least, exponent):
    """v d^(m_1 - 1), d^2 = v^2 + least, and its first and second derivative."""
    square = rate * rate
    inverse = 1.0 / (square + least)
    factor = exp((0.5 * (exponent - 1.0)) * log(square + least))
    value = rate * factor
    slope = factor * inverse * (least + exponent * square)
    return value, slope, (exponent - 1.0) * value * inverse * inverse * (3.0 * least + exponent * square)


@kernel
def advance_micro(law, increments, tile):
    """Micro-rate and micro-stress of a tile after a step, `increments` of `increments_of`; law of `in_numbers`."""
    step, theta, share = increments.step, increments.theta, increments.relax_stress
    softness, weight, inertial = 2.0 * law.shear_modulus * step, step * theta * theta, law.inertia_length > 0.0
    length_square = law.inertia_length * law.inertia_length
    for p in range(TILE):
        rate, stress, trial = tile[RATE * TILE + p], tile[STRESS * TILE + p], tile[TRIAL * TILE + p]
        density = tile[DENSITY * TILE + p]
        # in the middle of the step, from the old rate
        warm = tile[TEMPERATURE * TILE + p] + 0.5 * step * stress * rate / (density * law.specific_heat)
        gamma = tile[GAMMA * TILE + p] + 0.5 * step * rate
        strength = flow_strength(law, gamma, tile[CURL * TILE + p], warm) * increments.rate_factor
        # (the force, what is left of pi0, and (1 - theta) tau0) over theta, so that one weight stands before all
        pushed = tile[FORCE * TILE + p] + (1.0 - theta) * tile[TAU * TILE + p]
        drive = (pushed - (1.0 - theta * share) * stress) / theta
        inertia, low = length_square * density, (1.0 - theta) * rate
        # the root without G, an upper bound; beyond |S| = 0 inertia alone is left: the residual is the less of two
        # lines, its root the greater of two
        high = (inertia * rate + weight * (drive + trial)) / (inertia + weight * softness + 1e-300)
        free = rate + weight * drive / max(inertia, 1e-300)
        high = free if inertial and free > high else high
        high = low if low > high else high
        # without much inertia the last rate is nearer
        tile[MEAN_RATE * TILE + p] = rate if theta == 1.0 and high > rate else high
        tile[_LOW * TILE + p], tile[_HIGH * TILE + p] = low, high
        tile[_DRIVE * TILE + p], tile[_STRENGTH * TILE + p] = drive, strength
        tile[_LEAST * TILE + p] = least_rate_square(law, tile[GRADIENT_SQUARE * TILE + p])
        tile[_RESULT * TILE + p], tile[_MOVES * TILE + p] = 0.0 * high, 1.0
    _find_mean_rates(law, increments, tile)
    for p in range(TILE):
        rate, stress, mean = tile[RATE * TILE + p], tile[STRESS * TILE + p], tile[MEAN_RATE * TILE + p]
        left = tile[TRIAL * TILE + p] - softness * mean
        tau1 = 0.0 * left if left < 0.0 else left
        rate1 = (mean - (1.0 - theta) * rate) / theta
        relaxed = stress + share * (tile[_STRENGTH * TILE + p] * tile[_RESULT * TILE + p] - stress)
        # without inertia and relaxation it is |S|, of which the equation makes it the equal
        stress1 = relaxed if inertial or share < 1.0 else tau1
        flow = mean * step
        heat = ((1.0 - theta) * stress + theta * stress1) * flow
        work = (tile[FORCE * TILE + p] + 0.5 * (tile[TAU * TILE + p] + tau1)) * flow
        inertia = length_square * tile[DENSITY * TILE + p]
        tile[NEW_RATE * TILE + p], tile[NEW_TAU * TILE + p], tile[NEW_STRESS * TILE + p] = rate1, tau1, stress1
        tile[HEAT * TILE + p] = heat
        tile[LOST * TILE + p] = work - heat - 0.5 * inertia * (rate1 * rate1 - rate * rate)


@kernel
def _find_mean_rates(law, increments, tile):
    """MEAN_RATE, the root v >= (1 - theta) v0 of

        inertia (v - v0) - weight (drive + s(v)) + weight w strength v d^(m_1 - 1) = 0,

    and _RESULT, v d^(m_1 - 1) of it. A particle that has settled is not changed by others beside it.
    """
    step, theta, length_square = increments.step, increments.theta, law.inertia_length * law.inertia_length
    softness, weight = 2.0 * law.shear_modulus * step, step * theta * theta
    for iteration in range(_MOST_STEPS):
        moving, halley = 0, iteration < _HALLEY_STEPS
        tolerance = _SETTLED if halley else _SETTLED_NEWTON
        for p in range(TILE):
            x, low, high = tile[MEAN_RATE * TILE + p], tile[_LOW * TILE + p], tile[_HIGH * TILE + p]
            trial, inertia = tile[TRIAL * TILE + p], length_square * tile[DENSITY * TILE + p]
            resisting = weight * increments.relax_stress * tile[_STRENGTH * TILE + p]
            value, slope, curvature = _micro_stress(x, tile[_LEAST * TILE + p], law.rate_exponent)
            left = trial - softness * x
            left = 0.0 * left if left < 0.0 else left
            driven = weight * (tile[_DRIVE * TILE + p] + left)
            residual = inertia * (x - tile[RATE * TILE + p]) - driven + resisting * value
            steepness = inertia + resisting * slope + (weight * softness if left > 0.0 else 0.0)
            # a floor for where nothing resists, too low to be felt elsewhere
            steepness = steepness + 1e-12 * weight * softness + 1e-300
            low, high = (low if residual > 0.0 else x), (x if residual > 0.0 else high)
            newton = residual / steepness
            bend = 1.0 - 0.5 * newton * (resisting * curvature) / steepness
            far = x - newton / (0.25 if bend < 0.25 else bend)
            new = x - newton
            new = far if halley and not far > high else new
            # by rounding alone is Newton's rate beyond the upper bound
            new = high if new > high else new
            new = low if low > new else new
            change, moves = new - x, tile[_MOVES * TILE + p] > 0.0
            result = value + change * (slope + 0.5 * change * curvature)
            # a step over the corner of s(v) is not yet the last
            emptied = trial / (softness + 1e-300)
            crossed = (emptied - x) * (new - emptied) > 0.0
            tile[_LOW * TILE + p], tile[_HIGH * TILE + p] = low, high
            tile[_RESULT * TILE + p] = result if moves else tile[_RESULT * TILE + p]
            tile[MEAN_RATE * TILE + p] = new if moves else x
            moves = moves and (abs(change) > tolerance * new or crossed)
            tile[_MOVES * TILE + p] = 1.0 if moves else 0.0
            moving += 1 if moves else 0
        if moving == 0:
            break
