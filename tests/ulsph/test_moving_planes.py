"""Planes that move: images at the present plane, with its velocity, and the work that it does."""

import numpy as np
import pytest
from solids import COPPER, Record, follow, gathered, simulation
from ulsph.plates import block, scene

RATE = 2e4
# soft enough in shear that nothing flows
ELASTIC = COPPER | {"flow_stress": {"kind": "linear-hardening", "yield_stress": 1e12, "hardening": 0.0}}
SHEARED = [
    {"kind": "fixed", "plane": "Y = 0"},
    {"kind": "fixed", "plane": "Y = 1e-3", "velocity": [str(RATE * 1e-3), "0"]},
    {"kind": "antisymmetric", "plane": "X = 0"},
    {"kind": "antisymmetric", "plane": "X = 0.7e-3"},
]
PRESSED = [
    {"kind": "roller", "plane": "X = 0"},
    {"kind": "roller", "plane": "X = 0.7e-3", "velocity": [str(-RATE * 0.7e-3), "free"]},
    {"kind": "roller", "plane": "Y = 0"},
    {"kind": "roller", "plane": "Y = 1e-3"},
]


def layer(boundaries, velocity, **keys) -> dict:
    """A block of 7 x 10 particles of 0.1 mm."""
    return scene(block((7, 10), [0.7e-3, 1e-3], ELASTIC, velocity=velocity), boundaries=boundaries, **keys)


def test_walls_that_slide_keep_shear_uniform(comm):
    """To a shear of 2 %: S_xy = mu gamma of every particle, beside walls and free sides alike, and the walls' work."""
    sim = simulation(layer(SHEARED, [f"{RATE}*Y", 0.0], end_time=1e-6), comm)
    rows = follow(sim, Record())
    strain = RATE * rows["time"][-1]
    S, v, x = gathered(sim, "deviator", "velocity", "position")
    np.testing.assert_allclose(S[:, 3], 47.7e9 * strain, rtol=0.02)
    assert np.abs(v[:, 0] - RATE * x[:, 1]).max() < 0.02 * RATE * 1e-3
    # the area is .7 mm^2
    assert rows["external_work"][-1] == pytest.approx(0.5 * 47.7e9 * strain**2 * 0.7e-6, rel=0.02)
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["external_work"][-1]


def test_a_piston_compresses_uniformly(comm):
    """Exact density of every particle, the piston where it has gone to, its work that which the matter has."""
    sim = simulation(layer(PRESSED, [f"-{RATE}*X", 0.0], end_time=1e-6), comm)
    rows, system = follow(sim, Record()), sim.systems[0]
    stretch = 1.0 - RATE * rows["time"][-1]
    (density,) = gathered(sim, "density")
    assert np.ptp(density) < 1e-6 * density[0]
    np.testing.assert_allclose(density * stretch, 8930.0, rtol=1e-4)
    np.testing.assert_allclose(system.planes.travelled, [-RATE * 0.7e-3 * rows["time"][-1]], rtol=1e-12)
    assert np.abs(rows["energy_error"]).max() < 1e-4 * rows["external_work"][-1]
