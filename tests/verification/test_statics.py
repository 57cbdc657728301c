"""Equilibria beside the theory of Orowan."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from tlsph.test_load_history import METAL
from tlsph.test_stages import run
from tlsph.test_static_tools import of_tools, press, pressed


def mean_pressure(friction, width):
    """Over 2 k, on a perfectly plastic billet of a width over its height, in plane strain between dies that it slips
    along: the slab method with the shear, linear across the height, in the condition of flow (E. Orowan, Proc. Inst.
    Mech. Eng. 150 (1943) 140; without it, Siebel's)."""

    def share(p):
        s = 2.0 * friction * p
        return 0.5 * (np.sqrt(1.0 - s * s) + np.arcsin(s) / s)

    def slope(x, state):
        p = state[0]
        grown = (share(p * (1.0 + 1e-6)) - share(p * (1.0 - 1e-6))) / (2e-6 * p)
        return [friction * width * p / (1.0 - grown), p]

    edge = brentq(lambda p: p - share(p), 0.5, 1.0)
    return solve_ivp(slope, (0.0, 1.0), [edge, 0.0], rtol=1e-8).y[1, -1]


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.parametrize("friction", [0.1, 0.2])
def test_upsetting(comm, friction):
    """The mean pressure on a billet that dies with friction upset by 2 %."""
    reduction = 0.02
    data = pressed([press(0.5, f"-{0.5 * reduction}", friction=friction)], particles=(9, 5))
    flow = {"kind": "linear-hardening", "yield_stress": 0.4, "hardening": 0.0}
    data["bodies"][0]["material"] = METAL | {"flow_stress": flow}
    data["bodies"][0]["shape"] = {"box": {"lower": [0.0, 0.0], "upper": [1.0, 0.5]}}
    sim, rows = run(data, comm)
    expected = 2.0 / np.sqrt(3.0) * 0.4 * mean_pressure(friction, 2.0 / (1.0 - reduction) ** 2)
    assert of_tools(sim)["press.force_y"] * (1.0 - reduction) == pytest.approx(expected, rel=0.004)
    assert sim.systems[0].statics.load_steps < 40
    assert np.abs(rows["energy_error"]).max() < 1e-6 * rows["external_work"][-1]
