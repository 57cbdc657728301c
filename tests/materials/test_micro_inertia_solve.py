"""The local solve of the micro-inertia law over extreme states, and the fluxes beside it."""

import math

import numpy as np
import pytest
from micro_inertia_laws import STEEL, advance, classical, solved, stated

from parsolid.materials.plastic import micro_inertia as laws
from parsolid.materials.plastic.micro_inertia import in_numbers
from parsolid.materials.plastic.micro_inertia_solve import increments_of

pytestmark = pytest.mark.serial
FULL = stated({})
# l_m^2 [m^2], t_pi, dt [s], l_3 [m]
EXTREMES = (
    (1e-5, 9e-5, 2.34e-8, 1e-8),
    (1e-12, 1e-9, 2.34e-8, 1e-3),
    (1e-4, 1e-3, 1e-7, 1e-5),
    (1e-7, 1e-9, 1e-8, 1e-4),
    (1e-10, 9e-5, 2e-9, 1e-4),
    (1e-6, 1e-6, 1e-5, 1e-8),
)


def random_states(random, count):
    """(10, count): the arguments of advance_micro after the increments, over all that a particle may meet."""
    some = random.random((4, count))
    rate = np.where(some[0] < 0.2, 0.0, 10.0 ** random.uniform(-3.0, 6.0, count))
    tau = np.where(some[1] < 0.1, 0.0, 10.0 ** random.uniform(5.0, 10.5, count))
    trial = np.where(some[2] < 0.1, 0.0, tau * 10.0 ** random.normal(0.0, 0.3, count))
    stress = np.where(some[3] < 0.2, 0.0, 10.0 ** random.uniform(5.0, 10.0, count))
    gamma, curl = 10.0 ** random.uniform(-5.0, 0.5, count), 10.0 ** random.uniform(0.0, 6.0, count)
    force = random.normal(0.0, 1.0, count) * 10.0 ** random.uniform(4.0, 10.0, count)
    square, density = 10.0 ** random.uniform(0.0, 16.0, count), 7830.0 * random.uniform(0.8, 1.2, count)
    return np.array(
        [density, tau, trial, rate, stress, gamma, curl, random.uniform(250.0, 2000.0, count), force, square]
    )


def extreme(inertia_square, time, dissipative):
    return FULL._replace(
        inertia_length=math.sqrt(inertia_square),
        stress_relaxation_time=time,
        dissipative_length=dissipative,
        reference_rate=40.0,
    )


def residual(law, increments, v1, density, tau, trial, rate, stress, gamma, curl, T, force, square):
    """The equation of the module's docstring, written as on paper [Pa]; rises with v1."""
    step, theta = increments.step, increments.theta
    v = (1.0 - theta) * rate + theta * v1
    T = T + 0.5 * step * stress * rate / (density * law.specific_heat)
    hardened = 1.0 + law.hardening / law.yield_stress * (gamma + 0.5 * step * rate)
    strength = law.yield_stress * np.sqrt(hardened**2 + law.hardening_length * curl)
    warm = np.clip((T - law.reference_temperature) / (law.melting_temperature - law.reference_temperature), 0.0, 1.0)
    d = np.sqrt(v * v + law.dissipative_length**2 * square + law.regularisation**2)
    G = strength * (d / law.reference_rate) ** law.rate_exponent * (1.0 - warm**law.thermal_exponent) * v / d
    keep = math.exp(-step / law.stress_relaxation_time)
    pi1 = keep * stress + (1.0 - keep) * G
    s = np.maximum(trial - 2.0 * law.shear_modulus * step * v, 0.0)
    drive = force + (1.0 - theta) * (tau - stress) + theta * (s - pi1)
    return density * law.inertia_length**2 * (v1 - rate) / step - drive, s, pi1, v


@pytest.mark.parametrize("inertia_square, time, step, dissipative", EXTREMES)
def test_the_root_of_the_equation(random, inertia_square, time, step, dissipative):
    """The rate is the root to 1e-12, or 0 where the residual at 0 is positive; |S|, pi as the equation has them."""
    law, x = extreme(inertia_square, time, dissipative), random_states(random, 2000)
    increments = increments_of(law, step)
    rate, mean, tau, stress, heat, _ = solved(law, increments, x)
    assert (rate >= 0.0).all() and (tau >= 0.0).all() and (stress >= 0.0).all() and (heat >= 0.0).all()
    found, s, pi1, v = residual(law, increments, rate, *x)
    assert v == pytest.approx(mean, rel=1e-14)
    assert (abs(tau - s) <= 1e-14 * x[2]).all() and (abs(stress - pi1) <= 1e-10 * pi1 + 1e-14 * x[4]).all()
    above, below = (residual(law, increments, rate + side * 1e-11 * v, *x)[0] for side in (1.0, -1.0))
    # terms of different size cancel in the residual itself
    size = 1e-14 * (x[0] * law.inertia_length**2 * (rate + x[3]) / step + abs(x[8]) + x[1] + x[2] + x[4] + stress)
    assert (above >= -size).all() and ((below <= size) | (rate == 0.0)).all()
    assert (rate == 0.0).sum() > 10 and (found[rate == 0.0] >= -size[rate == 0.0]).all()


@pytest.mark.parametrize("inertia_square, time, step, dissipative", EXTREMES[:2])
def test_a_particle_does_not_feel_those_beside_it(random, inertia_square, time, step, dissipative):
    law, x = extreme(inertia_square, time, dissipative), random_states(random, 400)
    increments, order = increments_of(law, step), random.permutation(400)
    assert (solved(law, increments, x[:, order]) == solved(law, increments, x)[:, order]).all()


def test_a_number_that_is_none_stays_none(random):
    law, x = extreme(*EXTREMES[0][:2], 1e-5), random_states(random, 40)
    increments = increments_of(law, 1e-8)
    sound = solved(law, increments, x)
    for k in range(10):
        spoilt = x.copy()
        spoilt[k, 1::4] = np.nan
        result = solved(law, increments, spoilt)
        assert np.isnan(result[[0, 1, 3], 1::4]).all(), k
        others = np.arange(40) % 4 != 1
        assert (result[:, others] == sound[:, others]).all()


def test_energy_closes(random):
    """Nothing is lost with theta = 1/2 where no constraint holds; what a constraint takes is what is missing."""
    law, x = extreme(1e-5, 9e-5, 1e-8), random_states(random, 2000)
    increments = increments_of(law, 1e-8)
    rate, mean, tau, stress, heat, lost = solved(law, increments, x)
    density, tau0, _, rate0, stress0, force = x[[0, 1, 2, 3, 4, 8]]
    inertia = density * law.inertia_length**2
    size = 1e-8 * mean * (abs(force) + tau0 + tau + stress0 + stress) + inertia * (rate**2 + rate0**2)
    free = rate > 0.0
    assert increments.theta == 0.5 and free.sum() > 1000 and (abs(lost[free]) <= 1e-13 * size[free]).all()
    assert heat == pytest.approx(0.5 * (stress0 + stress) * mean * 1e-8, rel=1e-12)
    work = (force + 0.5 * (tau0 + tau)) * mean * 1e-8
    assert work - heat - 0.5 * inertia * (rate**2 - rate0**2) == pytest.approx(lost, abs=1e-12 * size.max())
    assert abs(lost[~free]).max() > 0.0


def test_rest_melt_and_a_step_of_no_length():
    for law in (FULL, classical()):
        at_rest = advance(law, increments_of(law, 1e-8), 7830.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 298.0, 0.0, 0.0)
        assert at_rest == (0.0,) * 6
        # nothing resists in a melt: |S| falls to 0 (in the classical limit at once), pi relaxes or is 0
        melted = advance(law, increments_of(law, 1e-8), 7830.0, 1e9, 1e9, 5e4, 1e9, 1.0, 0.0, 1e4, 0.0, 0.0)
        assert np.isfinite(melted).all() and melted[2] < 1e9 and melted[3] < 1e9
        still = advance(law, increments_of(law, 0.0), 7830.0, 1e9, 1e9, 5e4, 1e9, 1.0, 0.0, 400.0, 0.0, 0.0)
        assert (still[2], still[4]) == (1e9, 0.0) and (still[0] == 5e4) == (law.inertia_length is not None)


@pytest.mark.parametrize("stress", [0.0, 1e-8, 1e-6, 1.0, 1e9])
def test_a_melt_without_inertia(stress):
    """A micro-stress that relaxes is all that resists: |S| falls to what is left of it, or stays if it is less."""
    law = STEEL._replace(inertia_length=None)
    increments = increments_of(law, 1e-6)
    for tau in (1e-3, 1e9):
        rate, _, tau1, stress1, heat, _ = advance(
            law, increments, 7830.0, tau, tau, 1e3, stress, 1.0, 0.0, 1e4, 0.0, 0.0
        )
        assert stress1 == pytest.approx(stress * math.exp(-1.0 / 90.0), rel=1e-12)
        assert tau1 == pytest.approx(min(tau, stress1), rel=1e-9, abs=1e-12 * tau) and rate >= 0.0 and heat >= 0.0


def fluxes_after(law, step, energetic, dissipative, gradient, rate, gamma, curl, temperature):
    """Both micro-fluxes after a step."""
    law, increments = in_numbers(law), increments_of(law, step)
    square = sum(component * component for component in gradient)
    resistance = laws.resistance(law, rate, square, gamma, curl, temperature)
    relaxed = laws.dissipative_flux(law, increments.relax_flux, dissipative, gradient, resistance)
    return laws.energetic_flux(law, step, energetic, gradient), relaxed


def test_fluxes_relax_exactly_and_dissipate_what_the_paper_says(random):
    """Row 7 of the misprints: pi v^p + xi_dis . grad v^p = S_g R_1 R_2 d^p when all has relaxed, l_3 = .1 mm."""
    law = FULL._replace(dissipative_length=1e-4)
    g, v, gamma, curl, T = (3e7, -4e7, 0.0), 5e3, 0.3, 2e3, 700.0
    instant = law._replace(flux_relaxation_time=None)
    energetic, relaxed = fluxes_after(instant, 1e-8, (1.0, 2.0, 0.0), (7.0, 8.0, 0.0), g, v, gamma, curl, T)
    expected = (1.0 + 1e-8 * 792e6 * 25e-10 * 3e7, 2.0 - 1e-8 * 792e6 * 25e-10 * 4e7, 0.0)
    assert energetic == pytest.approx(expected, rel=1e-14)
    d = math.sqrt(v**2 + 1e-8 * 25e14 + 1e-4)
    strength = laws.flow_strength(law, gamma, curl, T) * d**0.2
    pi = strength * v / d
    assert pi * v + relaxed[0] * g[0] + relaxed[1] * g[1] == pytest.approx(strength * (d - 1e-4 / d), rel=1e-14)
    # twice half the step is the step
    start, state = (1e3, -2e3, 5e2), ((3e7, -4e7, 1e6), v, gamma, curl, T)
    whole = fluxes_after(law, 2e-6, start, start, *state)
    twice = fluxes_after(law, 1e-6, *fluxes_after(law, 1e-6, start, start, *state), *state)
    assert np.array(whole) == pytest.approx(np.array(twice), rel=1e-13)
    assert fluxes_after(STEEL, 1e-6, (0.0,) * 3, (0.0,) * 3, *state) == ((0.0,) * 3, (0.0,) * 3)


def test_heat_flux():
    g, q = (2.0, -1.0, 0.0), (5.0, 6.0, 0.0)
    share = increments_of(FULL, 1e-7).relax_heat
    expected = [math.exp(-1.0) * a - (1.0 - math.exp(-1.0)) * 38.0 * b for a, b in zip(q, g)]
    assert laws.heat_flux(FULL, share, q, g) == pytest.approx(expected, rel=1e-14)
    fourier = FULL._replace(heat_relaxation_time=None)
    assert laws.heat_flux(fourier, increments_of(fourier, 1e-7).relax_heat, q, g) == (-76.0, 38.0, 0.0)


def test_curl_of_the_plastic_distortion(random):
    """|curl(v N)| of a uniform N, eps_jkl N_il g_k row by row, is sqrt(|g|^2 - |N g|^2)."""
    A = random.standard_normal((3, 3))
    N = A + A.T
    N /= np.linalg.norm(N)
    g = random.standard_normal(3)
    epsilon = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        epsilon[i, j, k], epsilon[i, k, j] = 1.0, -1.0
    curl = np.einsum("jkl,il,k->ij", epsilon, N, g)
    direction = (N[0, 0], N[1, 1], N[2, 2], N[0, 1], N[0, 2], N[1, 2])
    assert laws.curl_rate(tuple(g), direction) == pytest.approx(np.linalg.norm(curl), rel=1e-13)


def test_energies():
    """de/d(rho) = p/rho^2; the gradient energy gives xi' . xi/(S_0 l_1^2) = xi . grad v^p."""
    law, rho, d = FULL, 7830.0 * 1.07, 1e-2
    slope = (laws.volumetric_energy(law, (rho + d) / 7830.0) - laws.volumetric_energy(law, (rho - d) / 7830.0)) / (
        2.0 * d
    )
    assert slope == pytest.approx(laws.pressure(law, rho / 7830.0) / rho**2, rel=1e-6)
    assert laws.pressure(law, 1.07) > 0.0 and laws.volumetric_energy(law, 1.0) == 0.0
    g, xi, step = (3e7, -4e7, 0.0), (20.0, 50.0, 0.0), 1e-9
    new = laws.energetic_flux(law, step, xi, g)
    middle = [0.5 * (a + b) for a, b in zip(new, xi)]
    gain = laws.gradient_energy(law, np.dot(new, new)) - laws.gradient_energy(law, np.dot(xi, xi))
    assert gain == pytest.approx(step * (middle[0] * g[0] + middle[1] * g[1]), rel=1e-12)
    assert laws.micro_kinetic_energy(law, rho, 10.0) == pytest.approx(0.5 * rho * 1e-5 * 100.0, rel=1e-14)
    without = in_numbers(classical())
    assert laws.micro_kinetic_energy(without, rho, 10.0) == 0.0 == laws.gradient_energy(without, 0.0)


@pytest.mark.parametrize("time", [None, 1e-9, 1e-6, 1e-3])
def test_stable_steps_are_those_of_a_mode(time):
    """v' = -k xi, t xi' + xi = D k v with exact relaxation: stable at the step, not at 2.2 times the longer bound."""
    law = FULL._replace(heat_relaxation_time=time)
    length, diffusivity = 3e-4, law.conductivity / (law.density * law.specific_heat)
    k, limit = 2.0 / length, laws.heat_time_step(in_numbers(law), length)

    def growth(step):
        share = 1.0 if time is None else 1.0 - math.exp(-step / time)
        motion = np.array(
            [[1.0, -step * k], [share * diffusivity * k, 1.0 - share - share * step * diffusivity * k * k]]
        )
        return abs(np.linalg.eigvals(motion)).max()

    assert growth(limit * 0.999) <= 1.0 + 1e-12 and growth(limit * 2.2) > 1.0
