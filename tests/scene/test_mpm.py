"""Scenes of the material point method: what they may say and what is refused."""

import copy
from pathlib import Path

import numpy as np
import pytest

from parsolid.exact import SOLUTIONS
from parsolid.particles.initial_fields import initial_temperature
from parsolid.scene import dump_scene, load_scene, parse_scene

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


@pytest.fixture
def tables():
    return copy.deepcopy(SQUARE)


def test_sound_scene_and_back(tables, tmp_path):
    scene = parse_scene(tables)
    method = scene.method
    assert (method.basis, method.transfer, method.order, method.cfl) == ("quadratic-spline", "apic", "musl", 0.3)
    assert (method.viscosity.linear, method.viscosity.quadratic) == (0.2, 2.0)
    dump_scene(scene, tmp_path / "scene.toml")
    assert load_scene(tmp_path / "scene.toml", [f"output.directory={scene.output.directory}"]) == scene
    temperature = initial_temperature(scene, np.zeros(2, int), np.array([[0.0, 0.5], [1.0, 0.5]]), np.array([77.0]))
    np.testing.assert_allclose(temperature, [300.0, 310.0])


RUNS = Path(__file__).parents[2] / "runs" / "mpm"


@pytest.mark.parametrize("path", sorted(RUNS.glob("*.toml")), ids=lambda path: path.stem)
def test_scenes_of_the_runs(path, tmp_path):
    """Each loads, comes back from its resolved form, and its reference, where it has one, can be made."""
    scene = load_scene(path)
    dump_scene(scene, tmp_path / "scene.toml")
    assert load_scene(tmp_path / "scene.toml") == scene
    if scene.reference is not None and scene.reference.exact is not None:
        solution = SOLUTIONS[scene.reference.exact].of_scene(scene)
        assert solution.scales if scene.reference.each_step else solution.error_names(scene.dimension)


def test_initial_velocities_of_the_manufactured_runs():
    """What the scenes state is the velocity of the exact solution."""
    for name, X in (("axis_aligned", [[0.2, 0.7]]), ("vortex", [[0.7, -0.6]])):
        scene, X = load_scene(RUNS / f"{name}.toml"), np.array(X)
        solution = SOLUTIONS[scene.reference.exact].of_scene(scene)
        np.testing.assert_allclose(
            scene.bodies[0].velocity.evaluate(X), solution.fields(X, 0.0)["velocity"], rtol=1e-12
        )
