"""Blocks on a rigid plane with friction: they slide as points do, stick, and stop, in every method."""

import numpy as np
import pytest
from tools.tool_scenes import METHODS, block, floor, run

GRAVITY, FRICTION = 10.0, 0.3


def on_incline(method: str, slope: float, end: float, ramp: float, **body) -> dict:
    """On an incline of a slope, in its own axes; the load grows over a time [s]."""
    angle = np.arctan(slope)
    grown = f"where(t < {ramp}, 0.5 - 0.5*cos(pi*t/{ramp}), 1)"
    # softer than other blocks with tools, so that steps are longer, and stiff enough to stop where a point does
    soft = METHODS[method][1] | {"youngs_modulus": 4e6}
    along, across = GRAVITY * np.sin(angle), GRAVITY * np.cos(angle)
    loads = {"acceleration": [f"{along}*{grown}", f"-{across}*{grown}"]}
    return block(method, material=soft, **body) | {"end_time": end, "loads": loads, "tools": [floor(friction=FRICTION)]}


@pytest.mark.parametrize("method", METHODS)
def test_a_block_slides_down_an_incline(method):
    _, watch = run(on_incline(method, 0.5, 0.3, 0.15))
    angle = np.arctan(0.5)
    exact = GRAVITY * (np.sin(angle) - FRICTION * np.cos(angle))
    late = watch["time"] > 0.18
    found = np.polyfit(watch["time"][late], watch["velocity"][late, 0], 1)[0]
    assert abs(found / exact - 1.0) < 3e-3
    weight = watch["mass"][0] * GRAVITY * np.cos(angle)
    assert abs(np.mean(-watch["floor.force_y"][late]) / weight - 1.0) < 3e-3
    assert np.all(np.diff(watch["friction_dissipation"]) >= 0.0)
    assert np.abs(watch["energy_error"]).max() < 1e-3 * watch["external_work"].max()
    if method == "mpm":
        # a wrong work of loads or tools would be there, and not in the balance
        assert abs(watch["numerical_dissipation"][-1]) < 1e-3 * watch["external_work"][-1]


@pytest.mark.parametrize("method", METHODS)
def test_a_block_sticks_on_a_gentle_incline(method):
    data = on_incline(method, 0.2, 0.3, 0.2)
    _, watch = run(data)
    late = watch["time"] > 0.2
    assert np.ptp(watch["place"][late, 0]) < 1e-3 and np.abs(watch["velocity"][-1]).max() < 5e-3
    assert abs(np.mean(watch["floor.force_x"][late]) / (watch["mass"][0] * GRAVITY * np.sin(np.arctan(0.2))) - 1) < 0.02


@pytest.mark.parametrize("method", METHODS)
def test_a_sliding_block_stops(method):
    """v^2/(2 mu g) from when the weight has grown to its end."""
    speed, grows = 0.6, 0.1
    _, watch = run(on_incline(method, 0.0, 0.3, grows, velocity=[speed, 0.0]))
    left = speed - 0.5 * FRICTION * GRAVITY * grows
    before = speed * grows - FRICTION * GRAVITY * grows**2 * (0.25 - np.pi**-2)
    went = watch["place"][-1, 0] - watch["place"][0, 0]
    assert abs(went / (before + left**2 / (2.0 * FRICTION * GRAVITY)) - 1.0) < 0.01
    assert np.abs(watch["velocity"][-1]).max() < 0.05 * speed
