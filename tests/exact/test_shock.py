"""The Hugoniot of copper against published states, and against the conservation laws and the energy equation."""

import numpy as np
import pytest

from parsolid.exact.shock import Hugoniot

COPPER = (8930.0, 3940.0, 1.489, 2.02, 383.0, 300.0)


@pytest.mark.parametrize(
    "speed, shock, jacobian, pressure, temperature",
    [(500.0, 4684.5, 0.893265, 20.9163e9, 410.10), (1000.0, 5429.0, 0.815804, 48.481e9, 714.42)],
)
def test_states_of_copper(speed, shock, jacobian, pressure, temperature):
    state = Hugoniot(*COPPER, speed)
    assert state.shock_speed == pytest.approx(shock, abs=0.05)
    assert state.jacobian == pytest.approx(jacobian, abs=5e-7)
    assert state.pressure == pytest.approx(pressure, rel=2e-5)
    assert state.temperature == pytest.approx(temperature, abs=0.01)


def test_jump_conditions_and_temperature_by_integration():
    rho0, C0, S, gamma, Cv, T0 = COPPER
    state = Hugoniot(*COPPER, 800.0)
    assert rho0 * state.shock_speed == pytest.approx(rho0 / state.jacobian * (state.shock_speed - 800.0), rel=1e-13)
    assert state.energy == pytest.approx(0.5 * state.pressure * (1.0 - state.jacobian), rel=1e-13)
    # along the Hugoniot dE = -P dJ + T dS by small trapezoid steps
    x = np.linspace(0.0, 1.0 - state.jacobian, 20001)
    P = rho0 * C0**2 * x / (1.0 - S * x) ** 2
    T = T0
    for i in range(len(x) - 1):
        dx = x[i + 1] - x[i]
        heat = (0.5 * (P[i + 1] * x[i + 1] - P[i] * x[i]) - 0.5 * (P[i] + P[i + 1]) * dx) / (rho0 * Cv)
        T = (T * (1.0 + 0.5 * gamma * dx) + heat) / (1.0 - 0.5 * gamma * dx)
    assert state.temperature == pytest.approx(T, abs=1e-3)
