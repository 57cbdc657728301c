"""The law of micro-inertia on four particles at once, for methods that have not moved to `micro_inertia`."""

import math

from decomposition.deferred import register_jitable
from parsolid.materials.plastic.micro_inertia import MicroIncrements, MicroInertia
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.elementary import choose, power, some_positive
from parsolid.numerics.tensors import expand, formula


@register_jitable
def _raised(base, exponent):
    """base^exponent of a base that is not negative; NaN stays NaN."""
    if exponent == 1.0:
        return 1.0 * base
    if exponent == 2.0:
        return base * base
    return power(base, exponent) + 0.0 * base


@register_jitable
def _with_gradients(length, hardened, curl):
    """sqrt(f^2 + l_2 eta^p), f without the length."""
    if length is None:
        return hardened
    return math.sqrt(hardened * hardened + length * curl)


@generic
def flow_strength(law, gamma, curl, temperature):
    """S_g R_2 [Pa] of gamma, eta^p = curl [1/m] (None without hardening_length) and T [K]; 0 from melting on."""


@flow_strength.of(MicroInertia)
def _flow_strength(law, gamma, curl, temperature):
    hardened = 1.0 + law.hardening / law.yield_stress * _raised(gamma, law.exponent)
    warm = (temperature - law.reference_temperature) / (law.melting_temperature - law.reference_temperature)
    warm = choose(-warm, 0.0 * warm, warm)
    warm = choose(warm - 1.0, 0.0 * warm + 1.0, warm)
    strength = law.yield_stress * _with_gradients(law.hardening_length, hardened, curl)
    return strength * (1.0 - _raised(warm, law.thermal_exponent))


@register_jitable
def _least_square(length, least, rate, gradient_square):
    if length is None:
        return 0.0 * rate + least * least
    return length * length * gradient_square + least * least


@register_jitable
def least_rate_square(law, rate, gradient_square):
    """d^p^2 - v^p^2 = l_3^2 |grad v^p|^2 + d_reg^2 [1/s^2]; gradient_square is None without dissipative_length."""
    return _least_square(law.dissipative_length, law.regularisation, rate, gradient_square)


@register_jitable
def _resistance(law, rate, gradient_square, gamma, curl, temperature):
    """S_g R_1 R_2/d^p [Pa s]."""
    square = rate * rate + least_rate_square(law, rate, gradient_square)
    factor = law.reference_rate ** (-law.rate_exponent)
    strength = flow_strength(law, gamma, curl, temperature) * factor
    return strength * math.exp(0.5 * (law.rate_exponent - 1.0) * math.log(square)) + 0.0 * square


@generic(on="x")
def _combined(a, x, b, y):
    """a x + b y of tuples."""


@_combined.of(2)
def _combined_plane(a, x, b, y):
    return a * x[0] + b * y[0], a * x[1] + b * y[1]


@_combined.of(3)
def _combined_space(a, x, b, y):
    return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]


@register_jitable
def _squared(x):
    result = x[0] * x[0] + x[1] * x[1]
    for k in range(2, len(x)):
        result = result + x[k] * x[k]
    return result


@register_jitable
def relaxed_share(relax):
    """What relaxes in a step of what is left: all of it without a relaxation time."""
    if relax is None:
        return 1.0
    return relax


@none_without("length")
def _advanced_energetic(length, law, step, flux, gradient):
    return _combined(1.0, flux, step * law.yield_stress * length * length, gradient)


@none_without("length")
def _advanced_dissipative(length, law, increments, flux, gradient, rate, gamma, curl, temperature):
    share = relaxed_share(increments.relax_flux)
    resistance = _resistance(law, rate, _squared(gradient), gamma, curl, temperature)
    return _combined(1.0 - share, flux, share * length * length * resistance, gradient)


@generic
def advance_fluxes(law, increments, xi_en, xi_dis, gradient, rate, gamma, curl, temperature):
    """Energetic and dissipative micro-flux [Pa m] after a step with grad v^p = gradient [1/(m s)] at its end.

    All vectors are tuples of two or three components; xi_en is None without energetic_length, xi_dis without
    dissipative_length, curl without hardening_length. The dissipative one relaxes exactly, at once without
    flux_relaxation_time ((3.20), (3.21) with 1/d^p, and in rates that are not objective, as the paper's).
    """


@advance_fluxes.of(MicroInertia)
def _advance_fluxes(law, increments, xi_en, xi_dis, gradient, rate, gamma, curl, temperature):
    energetic = _advanced_energetic(law.energetic_length, law, increments.step, xi_en, gradient)
    dissipative = _advanced_dissipative(
        law.dissipative_length, law, increments, xi_dis, gradient, rate, gamma, curl, temperature
    )
    return energetic, dissipative


@none_without("conductivity")
def _advanced_heat(conductivity, relax, flux, gradient):
    share = relaxed_share(relax)
    return _combined(1.0 - share, flux, -share * conductivity, gradient)


@register_jitable
def advance_heat_flux(law, increments, q, temperature_gradient):
    """Heat flux [W/m^2] after a step with grad T [K/m] at its end, exact relaxation (Cattaneo), Fourier's without
    heat_relaxation_time; None without conductivity. Tuples of two or three components.
    """
    return _advanced_heat(law.conductivity, increments.relax_heat, q, temperature_gradient)


@formula
def _square_across(gradient, direction):
    """|g|^2 - |N g|^2 of two or three components."""
    N, count = expand(direction), len(gradient)
    width = 2 if count == 2 else 3
    along = [_dot(N[width * i : width * i + count], gradient) for i in range(count)]
    return _dot(gradient, gradient) - _dot(along, along)


def _dot(a, b):
    result = a[0] * b[0]
    for first, second in zip(a[1:], b[1:]):
        result = result + first * second
    return result


@register_jitable
def curl_rate(gradient, direction):
    """d(eta^p)/dt = sqrt(|g|^2 - |N g|^2) [1/(m s)] of g = grad v^p, a tuple of two or three components, and N = S/|S|,
    a symmetric tensor: the norm of the curl of the plastic distortion rate v^p N for a uniform N.
    """
    square = _square_across(gradient, direction)
    return math.sqrt(choose(-square, 0.0 * square, square))


@register_jitable
def pressure(law, density_ratio):
    """p = K (rho/rho_0 - 1) [Pa], positive in compression (3.13)."""
    return law.bulk_modulus * (density_ratio - 1.0)


@register_jitable
def volumetric_energy(law, density_ratio):
    """K/rho_0 (ln r + 1/r - 1) [J/kg], r = rho/rho_0: what p does in changing the density."""
    return law.bulk_modulus / law.density * (math.log(density_ratio) + 1.0 / density_ratio - 1.0)


@register_jitable
def deviatoric_energy(law, tau):
    """|S|^2/(4 mu) [J/m^3]."""
    return tau * tau / (4.0 * law.shear_modulus)


@register_jitable
def inertia_per_volume(length, density):
    """rho l_m^2 [kg/m]."""
    if length is None:
        return 0.0 * density
    return length * length * density


@register_jitable
def micro_kinetic_energy(law, density, rate):
    """rho l_m^2 v^p^2/2 [J/m^3]; 0 without inertia_length."""
    return 0.5 * inertia_per_volume(law.inertia_length, density) * rate * rate


@generic(on="xi_en")
def gradient_energy(law, xi_en):
    """|xi_en|^2/(2 S_0 l_1^2) [J/m^3]; 0 without energetic_length, where xi_en is None."""


@gradient_energy.of(None)
def _no_gradient_energy(law, xi_en):
    return 0.0


@gradient_energy.otherwise
def _gradient_energy(law, xi_en):
    return _squared(xi_en) / (2.0 * law.yield_stress * law.energetic_length * law.energetic_length)


@register_jitable
def _delayed(diffusivity, time, length):
    """Stable step [s] of a flux that relaxes towards -diffusivity grad: that of its wave, or of diffusion if longer.

    With the exact relaxation a mode k is stable while dt D k^2 tanh(dt/(2 t)) <= 2; here k = 2/length.
    """
    diffusion = 0.5 * length * length / diffusivity
    if time is None:
        return diffusion
    return max(diffusion, length * math.sqrt(time / diffusivity))


@register_jitable
def _energetic_step(law_length, law, length, inertia):
    if law_length is None:
        return 0.0 * inertia + math.inf
    return length / law_length * math.sqrt(inertia / law.yield_stress)


@register_jitable
def _dissipative_step(law_length, law, length, inertia, rate, gradient_square, gamma, curl, temperature):
    if law_length is None:
        return 0.0 * inertia + math.inf
    resistance = _resistance(law, rate, gradient_square, gamma, curl, temperature)
    # nothing resists in a melt
    resistance = choose(resistance, resistance, 1e-300)
    return _delayed(law_length * law_length * resistance / inertia, law.flux_relaxation_time, length)


@register_jitable
def micro_time_step(law, length, density, rate, gradient_square, gamma, curl, temperature):
    """Stable step [s] of micro-rate and micro-flux at a state, for particles whose operators see wave numbers up to
    2/length; infinite without energetic and dissipative length.

    Energetic wave: (l_1/l_m) sqrt(S_0/rho); dissipative wave: (l_3/l_m) sqrt(S_g R_1 R_2/(rho d^p t_xi)), or its
    diffusion where t_xi is shorter than the step. The micro-oscillator and t_pi are implicit and set no limit.
    """
    inertia = inertia_per_volume(law.inertia_length, density)
    energetic = _energetic_step(law.energetic_length, law, length, inertia)
    dissipative = _dissipative_step(
        law.dissipative_length, law, length, inertia, rate, gradient_square, gamma, curl, temperature
    )
    return 1.0 / math.sqrt(1.0 / (energetic * energetic) + 1.0 / (dissipative * dissipative))


@register_jitable
def _heat_step(conductivity, law, length):
    if conductivity is None:
        return math.inf
    return _delayed(conductivity / (law.density * law.specific_heat), law.heat_relaxation_time, length)


@register_jitable
def heat_time_step(law, length):
    """Stable step [s] of temperature and heat flux for wave numbers up to 2/length: Cattaneo's wave or diffusion,
    whichever is longer; infinite without conductivity.
    """
    return _heat_step(law.conductivity, law, length)


# Halley's method is cubic: what a change of this leaves is below rounding
_SETTLED, _SETTLED_NEWTON = 1e-5, 1e-8
_HALLEY_STEPS, _MOST_STEPS = 8, 60
# theta = 1/2 rings where omega dt is greater than this
_IMPLICIT_FROM = 0.5


@generic
def increments_of(law, step):
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
