"""The micro-inertia law at a material point: tabled states, order, closed forms, limits, rates (docs/ulsph.md).

Tabled values are those of an independent event-driven solver of the ordinary differential equations.
"""

import math

import numpy as np
import pytest
from micro_inertia_laws import STEEL, advance, classical, stated

from parsolid.materials.plastic import micro_inertia as laws
from parsolid.materials.plastic.micro_inertia import in_numbers, returned_deviator
from parsolid.materials.plastic.micro_inertia_solve import increments_of
from parsolid.materials.plastic.tile_update import deviatoric_strain
from parsolid.scene.materials import library_of_micro_inertia
from parsolid.tensors import combine_symmetric, congruence, contract_symmetric, spin_rotation, times_symmetric

pytestmark = pytest.mark.serial
# states after 100 us at 1e4/s
COMPRESSED = 4.306020e9, 1.323358e4, 4.682914e9, 1.41808777, 1303.0103
SHEARED = 4.016425e9, 5292.62, 3.825068e9, 0.69074469, 684.1079
# greatest |S| [GPa] of plane-strain compression to 100 us, or to a strain of 1 if that is earlier
RATES = 1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6
GREATEST = 2.32, 3.37, 5.04, 4.69, 15.60, 46.77, 153.8
GREATEST_CLASSICAL = 3.61, 4.74, 5.82, 7.08, 8.83, 10.87, 13.66
# |S| [Pa], gamma, T at 5, 10, 20, 30, 40, 50 us of the classical limit at 1e4/s
CLASSICAL = (
    (5446309060.0, 0.0355819847, 347.184076),
    (5641858170.0, 0.105031371, 450.39613),
    (5823435120.0, 0.245281556, 666.608025),
    (5671540020.0, 0.387682636, 886.877184),
    (5164315740.0, 0.532375588, 1097.83766),
    (4372744620.0, 0.678902578, 1285.60748),
)
CLASSICAL_TIMES = 5e-6, 10e-6, 20e-6, 30e-6, 40e-6, 50e-6


def compressed(law, rate, end, steps):
    """Rows of (tau, v^p, pi, gamma, T) of plane-strain compression, where the direction of S does not change."""
    increments = increments_of(law, end / steps)
    elastic = 2.0 * law.shear_modulus * math.sqrt(2.0) * rate * increments.step
    state = (0.0, 0.0, law.initial_micro_stress, 0.0, law.reference_temperature)
    rows = [state]
    for _ in range(steps):
        tau, speed, stress, gamma, T = state
        speed, mean, tau, stress, heat, _ = advance(
            law, increments, law.density, tau, tau + elastic, speed, stress, gamma, 0.0, T, 0.0, 0.0
        )
        state = (tau, speed, stress, gamma + mean * increments.step, T + heat / (law.density * law.specific_heat))
        rows.append(state)
    return np.array(rows)


NOTHING = (0.0,) * 6


def elastic_step(S, L, step, shear_modulus):
    """S turned by the spin of a step, and the elastic trial."""
    turn = spin_rotation(L, step)
    turned = congruence(turn, S)
    return turned, combine_symmetric(1.0, turned, 2.0 * shear_modulus, deviatoric_strain(turn, L, step))


def sheared(law, rate, end, steps):
    """The last (tau, v^p, pi, gamma, T) of simple shear, and S."""
    increments, L = increments_of(law, end / steps), (0.0, rate, *(0.0,) * 7)
    S, tau, speed, stress, gamma, T = NOTHING, 0.0, 0.0, 0.0, 0.0, law.reference_temperature
    for _ in range(steps):
        turned, trial = elastic_step(S, L, increments.step, law.shear_modulus)
        norm, before = math.sqrt(contract_symmetric(trial, trial)), tau
        state = (law.density, tau, norm, speed, stress, gamma, 0.0, T, 0.0, 0.0)
        speed, mean, tau, stress, heat, _ = advance(law, increments, *state)
        S = returned_deviator(turned, trial, before, tau, law.shear_modulus * mean * increments.step)
        gamma, T = gamma + mean * increments.step, T + heat / (law.density * law.specific_heat)
    return np.array([tau, speed, stress, gamma, T]), S


def test_tabled_compression():
    """.1 % at dt = 1e-8 s; the greatest |S| is met within a step. Errors fall as the square of the step."""
    coarse, middle, rows = (compressed(STEEL, 1e4, 1e-4, n) for n in (2500, 5000, 10000))
    errors = [abs(one[-1] / COMPRESSED - 1.0)[:2] for one in (coarse, middle, rows)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)
    assert rows[-1] == pytest.approx(COMPRESSED, rel=1e-3)
    assert rows[:, 0].max() == pytest.approx(5.039101e9, rel=1e-4)
    assert rows[:, 0].argmax() * 1e-8 == pytest.approx(97.62e-6, abs=2e-8)


def test_tabled_shear():
    state, S = sheared(STEEL, 1e4, 1e-4, 10000)
    assert state == pytest.approx(SHEARED, rel=1e-3)
    assert (S[0], S[3]) == (pytest.approx(9.586e7, rel=1e-3), pytest.approx(2.838423e9, rel=1e-3))


def test_frozen_micro_stress():
    """pi = 0: v^p = Dn (1 - cos wt), tau = sqrt(2 mu rho) l_m Dn sin wt, gamma = Dn (t - sin(wt)/w) until wt = pi."""
    law, Dn = STEEL._replace(stress_relaxation_time=1e30), math.sqrt(2.0) * 1e4
    w = math.sqrt(2.0 * law.shear_modulus / law.density) / law.inertia_length
    assert w == pytest.approx(1.4071463278e6, rel=1e-9)
    end, steps = 3.0 / w, 4000
    rows, t = compressed(law, 1e4, end, steps), np.linspace(0.0, end, steps + 1)
    amplitude = math.sqrt(2.0 * law.shear_modulus * law.density) * law.inertia_length * Dn
    assert rows[:, 1] == pytest.approx(Dn * (1.0 - np.cos(w * t)), abs=1e-6 * Dn)
    assert rows[:, 0] == pytest.approx(amplitude * np.sin(w * t), abs=1e-6 * amplitude)
    assert rows[:, 3] == pytest.approx(Dn * (t - np.sin(w * t) / w), abs=1e-6 * Dn * end)


@pytest.mark.parametrize("steps", [500, 1000])
def test_elastic_shear(steps):
    """Jaumann's rate: S12 = mu sin(gamma), S11 = mu (1 - cos gamma), here to gamma = 1; order 2."""
    S = NOTHING
    for _ in range(steps):
        S = elastic_step(S, (0.0, 1.0, *(0.0,) * 7), 1.0 / steps, 3.0)[1]
    assert (S[3], S[0], S[1]) == pytest.approx((3.0 * math.sin(1.0), 3.0 - 3.0 * math.cos(1.0), -S[0]), rel=1e-6)


def test_a_rotation_keeps_the_deviator_and_turns_it():
    """A rotation of the whole by 1.2 about an axis in space: S turns with it, and |S| stays to rounding."""
    S = (2.0, -1.0, -1.0, 0.3, -0.2, 0.5)
    spin, steps, norm = np.array([0.3, -0.5, 0.9]), 400, math.sqrt(contract_symmetric(S, S))
    W = np.array([[0.0, -spin[2], spin[1]], [spin[2], 0.0, -spin[0]], [-spin[1], spin[0], 0.0]])
    w, V = np.linalg.eig(1.2 * W)
    Q = (V @ np.diag(np.exp(w)) @ np.linalg.inv(V)).real
    full = np.array([[2.0, 0.3, -0.2], [0.3, -1.0, 0.5], [-0.2, 0.5, -1.0]])
    for _ in range(steps):
        S = congruence(spin_rotation(tuple(W.ravel()), 1.2 / steps), S)
    expected = Q @ full @ Q.T
    assert math.sqrt(contract_symmetric(S, S)) == pytest.approx(norm, rel=1e-13)
    assert tuple(S)[:4] == pytest.approx(tuple(expected[[0, 1, 2, 0], [0, 1, 2, 1]]), abs=2e-6)
    assert tuple(S)[4:] == pytest.approx((expected[0, 2], expected[1, 2]), abs=2e-6)


@pytest.mark.parametrize("flow", [0.0, 1e-3, 1e6, 1e12])
def test_the_deviator_where_nothing_is_left_of_it(flow):
    """|S| = 0 at both ends of a step, whatever flows in it, and a start from |S| = 0 along the strain."""
    zero, strain = NOTHING, (3.0, -1.0, -2.0, 0.5, 0.0, 0.0)
    assert tuple(returned_deviator(zero, strain, 0.0, 0.0, flow)) == NOTHING
    assert tuple(returned_deviator(zero, zero, 0.0, 0.0, flow)) == NOTHING
    norm = math.sqrt(contract_symmetric(strain, strain))
    started = returned_deviator(zero, strain, 0.0, 0.25 * norm, flow)
    assert tuple(started) == pytest.approx(times_symmetric(0.25, strain), rel=1e-14)


@pytest.mark.parametrize("rate, expected, slow", list(zip(RATES, GREATEST, GREATEST_CLASSICAL)))
def test_greatest_stress_against_rate(rate, expected, slow):
    """As tabled, to its three or four digits: above 3e4/s it is the first peak of the micro-oscillator."""
    end = min(1e-4, 1.0 / rate)
    assert compressed(STEEL, rate, end, 4000)[:, 0].max() / 1e9 == pytest.approx(expected, rel=1.5e-3)
    assert compressed(classical(), rate, end, 4000)[:, 0].max() / 1e9 == pytest.approx(slow, rel=1.5e-3)


def test_classical_limit():
    """Without l_m and t_pi: tau = pi to the bit, never clamped, and as tabled (first order: 2e-4 at 2.5 ns)."""
    rows = compressed(classical(), 1e4, 5e-5, 20000)
    assert (rows[:, 0] == rows[:, 2]).all() and (rows[1:, 0] > 0.0).all()
    found = rows[np.rint(np.array(CLASSICAL_TIMES) / 2.5e-9).astype(int)][:, [0, 3, 4]]
    assert found == pytest.approx(np.array(CLASSICAL), rel=2e-4)
    # a very small l_m and t_pi, which are stepped implicitly, give the same
    stiff = STEEL._replace(inertia_length=1e-6, stress_relaxation_time=1e-11)
    near = compressed(stiff, 1e4, 5e-5, 20000)
    assert near[::4000, [0, 3]] == pytest.approx(rows[::4000, [0, 3]], rel=1e-3)


def test_an_initial_micro_stress_is_an_elastic_range():
    """Below pi(0), which relaxes, nothing flows; without it the solid creeps from the start."""
    hard = compressed(STEEL._replace(initial_micro_stress=792e6), 1e3, 4e-6, 400)
    soft = compressed(STEEL, 1e3, 4e-6, 400)
    elastic = hard[:, 0] < 792e6 * math.exp(-4e-6 / 9e-5)
    elastic[np.argmin(elastic) :] = False
    assert elastic.sum() > 100 and (hard[elastic, 3] == 0.0).all() and soft[elastic, 3].max() > 1e-5


def test_the_library_states_table_1():
    law = stated({})
    assert (law.shear_modulus, law.bulk_modulus) == (
        pytest.approx(77.519e9, rel=1e-5),
        pytest.approx(158.730e9, rel=1e-5),
    )
    assert law.inertia_length**2 == pytest.approx(10e-6, rel=1e-14)
    assert (law.energetic_length, law.hardening_length, law.dissipative_length) == (5e-5, 1e-8, 1e-8)
    speeds = np.sqrt([(law.bulk_modulus + 4.0 / 3.0 * law.shear_modulus) / 7830.0, law.shear_modulus / 7830.0])
    assert speeds == pytest.approx([5785.5, 3146.5], rel=1e-5)
    assert list(library_of_micro_inertia()) == ["4340 steel, Rahaman"]
    # the speed of the energetic micro wave, and that of heat
    energetic = in_numbers(STEEL._replace(energetic_length=5e-5))
    step = laws.micro_time_step(energetic, 1.0, 7830.0, laws.resistance(energetic, 0.0, 0.0, 0.0, 0.0, 298.0))
    assert 1.0 / step == pytest.approx(5.03, abs=5e-3)
    # where the wave is slower than diffusion
    assert 1e-9 / laws.heat_time_step(law, 1e-9) == pytest.approx(10.09, abs=5e-3)
