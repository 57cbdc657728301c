"""Equilibria beside the slab method."""

import numpy as np
import pytest
from tlsph.test_load_history import METAL
from tlsph.test_stages import run
from tlsph.test_static_tools import of_tools, press, pressed


@pytest.mark.slow
@pytest.mark.serial
def test_upsetting(comm):
    """The mean pressure on a perfectly plastic billet in plane strain, upset by 2 % between dies with friction: that of
    the slab method, 2 k (exp(m) - 1)/m, m = mu b/h (Siebel 1923)."""
    reduction, friction = 0.02, 0.1
    data = pressed([press(0.5, f"-{0.5 * reduction}", friction=friction)], particles=(9, 5))
    flow = {"kind": "linear-hardening", "yield_stress": 0.4, "hardening": 0.0}
    data["bodies"][0]["material"] = METAL | {"flow_stress": flow}
    data["bodies"][0]["shape"] = {"box": {"lower": [0.0, 0.0], "upper": [1.0, 0.5]}}
    sim, rows = run(data, comm)
    m = friction * 2.0 / (1.0 - reduction) ** 2
    expected = 2.0 / np.sqrt(3.0) * 0.4 * np.expm1(m) / m
    assert of_tools(sim)["press.force_y"] * (1.0 - reduction) == pytest.approx(expected, rel=0.015)
    assert sim.systems[0].statics.load_steps < 40
    assert np.abs(rows["energy_error"]).max() < 1e-6 * rows["external_work"][-1]
