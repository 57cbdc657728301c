"""Scenes of the material point method: what they may say and what is refused."""

import copy

import numpy as np

from parsolid.particles.initial_fields import initial_temperature
from parsolid.scene import parse_scene

MATERIAL = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e7, "poissons_ratio": 0.3}
SQUARE = {
    "dimension": 2,
    "end_time": 0.02,
    "method": {"kind": "mpm", "cell": 0.125},
    "bodies": [
        {
            "shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}},
            "particles": [16, 16],
            "placement": "cells",
            "temperature": "300 + 10*X",
            "material": MATERIAL,
        }
    ],
    "boundaries": [
        {"kind": "roller", "plane": "X = 0"},
        {"kind": "wall", "plane": "Y = -3", "side": "above", "velocity": [0.0, 2.0], "contact": "sticking"},
    ],
    "loads": {"heat_source": "1e6*X", "manufactured": True},
    "reference": {"exact": "axis-aligned", "parameters": {"amplitude": 0.05}, "each_step": True},
}


def test_defaults_and_temperatures():
    scene = parse_scene(SQUARE)
    method = scene.method
    assert (method.basis, method.transfer, method.order, method.cfl) == ("quadratic-spline", "apic", "musl", 0.3)
    assert (method.viscosity.linear, method.viscosity.quadratic) == (0.2, 2.0)
    temperature = initial_temperature(scene, np.zeros(2, int), np.array([[0.0, 0.5], [1.0, 0.5]]), np.array([77.0]))
    np.testing.assert_allclose(temperature, [300.0, 310.0])


def test_particles_are_in_cells_where_the_method_takes_no_others():
    tables = copy.deepcopy(SQUARE)
    tables["methods"] = [tables.pop("method") | {"name": "grid"}, {"kind": "tlsph", "name": "other"}]
    del tables["loads"], tables["reference"], tables["boundaries"]
    del tables["bodies"][0]["placement"], tables["bodies"][0]["temperature"]
    other = copy.deepcopy(tables["bodies"][0]) | {"method": "other"}
    other["shape"]["box"] = {"lower": [3.0, 0.0], "upper": [4.0, 1.0]}
    tables["bodies"] = [tables["bodies"][0] | {"method": "grid"}, other]
    scene = parse_scene(tables)
    assert [one.placed_on for one in scene.bodies] == ["cells", "vertices"]
    assert parse_scene(scene.resolved()) == scene
