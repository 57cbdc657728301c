"""Conduction solutions.

the heat equation by differences, their boundaries, and published values of the plastic layer.
"""

import numpy as np
import pytest
from scipy.special import erfc

from parsolid.exact.heat import CosineMode, HeatedSlab, PlasticLayer

COPPER = 386.0 / (8960.0 * 383.0)
CASES = {
    "mode": (CosineMode(300.0, COPPER, 40.0, 0.02), 0.3, 0.0),
    "held face": (HeatedSlab(300.0, COPPER, 0.02, face_rise=50.0), 0.3, 0.0),
    "heated face": (HeatedSlab(300.0, COPPER, 0.02, gradient=2e4), 0.3, 0.0),
    "layer": (PlasticLayer(300.0, COPPER, 0.02, 1e3, 0.05), 0.3, 1e3),
}


def at(values) -> np.ndarray:
    """The same coordinate along X and Y."""
    return np.stack((values, values), axis=1)


@pytest.mark.parametrize("name", CASES)
def test_heat_equation(name):
    solution, time, source = CASES[name]
    x, step, instant = np.linspace(0.003, 0.017, 8), 1e-5, 1e-4
    left, middle, right = (solution.rise(at(x + offset), time) for offset in (-step, 0.0, step))
    rate = (solution.rise(at(x), time + instant) - solution.rise(at(x), time - instant)) / (2.0 * instant)
    conducted = COPPER * (left - 2.0 * middle + right) / step**2
    np.testing.assert_allclose(rate, conducted + source, rtol=2e-4, atol=2e-4 * np.abs(rate).max())


def test_faces():
    ends, step = np.array([0.0, 0.02]), 1e-7
    held, heated, layer = CASES["held face"][0], CASES["heated face"][0], CASES["layer"][0]
    assert held.rise(at(ends), 0.3)[0] == pytest.approx(50.0, abs=1e-10)
    np.testing.assert_allclose(layer.rise(at(ends), 0.3), 0.0, atol=1e-10)

    def slope(solution, x):
        return float(np.diff(solution.rise(at(np.array([x, x + step])), 0.3))[0] / step)

    assert slope(held, 0.02 - step) == pytest.approx(0.0, abs=1.0)
    assert slope(heated, 0.02 - step) == pytest.approx(0.0, abs=1.0)
    assert slope(heated, 0.0) == pytest.approx(-2e4, rel=1e-3)


def test_short_times_are_those_of_a_half_space():
    x, t = np.linspace(0.0, 0.006, 7), 2e-2
    held = CASES["held face"][0].rise(at(x), t)
    np.testing.assert_allclose(held, 50.0 * erfc(x / np.sqrt(4.0 * COPPER * t)), atol=1e-9)


def test_heated_slab_keeps_the_heat():
    x = (np.arange(2000) + 0.5) / 2000 * 0.02
    mean = CASES["heated face"][0].rise(at(x), 0.3).mean()
    assert mean == pytest.approx(2e4 * COPPER * 0.3 / 0.02, rel=1e-6)


@pytest.mark.parametrize("time, rise", [(1e-6, 6.057), (1e-5, 60.567)])
def test_plastic_layer_in_the_middle(time, rise):
    """Published: 400 MPa, 1e5 /s, zeta 0.9 in OFHC copper, 1 mm thick, rigid-plastic."""
    heating = 0.9 * 400e6 / np.sqrt(3.0) * 1e5 / (8960.0 * 383.0)
    layer = PlasticLayer(300.0, COPPER, 1e-3, heating, 0.0)
    assert layer.rise(at(np.array([5e-4])), time)[0] == pytest.approx(rise, abs=5e-4)


def test_nothing_heats_before_the_layer_yields():
    assert CASES["layer"][0].rise(at(np.array([0.01])), 0.04)[0] == 0.0
