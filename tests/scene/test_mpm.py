"""Scenes of the material point method: what they may say and what is refused."""

import copy
from pathlib import Path

import numpy as np
import pytest

from parsolid.exact import SOLUTIONS
from parsolid.particles.initial_fields import initial_temperature
from parsolid.scene import SceneError, dump_scene, load_scene, parse_scene

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


def faults_of(tables) -> list[str]:
    with pytest.raises(SceneError) as found:
        parse_scene(tables)
    return found.value.faults


def test_sound_scene_and_back(tables, tmp_path):
    scene = parse_scene(tables)
    method = scene.method
    assert (method.basis, method.transfer, method.order, method.cfl) == ("quadratic-spline", "apic", "musl", 0.3)
    assert (method.viscosity.linear, method.viscosity.quadratic) == (0.2, 2.0)
    dump_scene(scene, tmp_path / "scene.toml")
    assert load_scene(tmp_path / "scene.toml", [f"output.directory={scene.output.directory}"]) == scene
    temperature = initial_temperature(scene, np.zeros(2, int), np.array([[0.0, 0.5], [1.0, 0.5]]), np.array([77.0]))
    np.testing.assert_allclose(temperature, [300.0, 310.0])


def test_particles_are_in_cells_where_the_method_takes_no_others(tables):
    tables["methods"] = [tables.pop("method") | {"name": "grid"}, {"kind": "tlsph", "name": "other"}]
    del tables["loads"], tables["reference"], tables["boundaries"]
    del tables["bodies"][0]["placement"], tables["bodies"][0]["temperature"]
    other = copy.deepcopy(tables["bodies"][0]) | {"method": "other"}
    other["shape"]["box"] = {"lower": [3.0, 0.0], "upper": [4.0, 1.0]}
    tables["bodies"] = [tables["bodies"][0] | {"method": "grid"}, other]
    scene = parse_scene(tables)
    assert [one.placed_on for one in scene.bodies] == ["cells", "vertices"]
    assert parse_scene(scene.resolved()) == scene


@pytest.mark.parametrize(
    "place, value, told",
    [
        (("method", "basis"), "quintic", "method.basis: expected 'linear'"),
        (("method", "cell"), -1.0, "method.cell: expected a number > 0"),
        (("bodies", 0, "placement"), "vertices", "bodies.0.placement: expected 'cells'"),
        (("reference", "exact"), "viscoelastic-plate", "loads.manufactured: expected reference.exact = 'axis-aligned'"),
        (("reference", "parameters"), {"size": 1.0}, "reference.parameters: expected the parameters amplitude"),
        (
            ("boundaries", 0),
            {"kind": "temperature", "plane": "X = 0", "temperature": 300},
            "boundaries.0.kind: expected a body",
        ),
        (("output",), {"fields": ["temperature"]}, "output.fields.0: expected something that a body of this scene has"),
        (("boundaries", 1, "side"), "left", "boundaries.1.side: expected 'above' or 'below'"),
        (("boundaries", 1, "separation"), False, "boundaries.1.separation: expected"),
        (
            ("bodies", 0, "shape", "box", "lower"),
            [-1.0, 0.0],
            "bodies.0.shape.box.lower.0: expected a radius of at least 0",
        ),
    ],
)
def test_faults(tables, place, value, told):
    *way, last = place
    target = tables
    for key in way:
        target = target[key]
    target[last] = value
    tables["method"]["geometry"] = "axisymmetric"
    assert any(text.startswith(told) for text in faults_of(tables)), faults_of(tables)


def test_keys_of_other_methods(tables):
    rubber = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    tables["method"], tables["bodies"][0]["material"] = {"kind": "peridynamics"}, rubber
    found = faults_of(tables)
    assert any(text.startswith("bodies.0.temperature: expected no such key") for text in found)
    assert any(text.startswith("loads.heat_source: expected one of body_force, acceleration") for text in found)
    assert any(text.startswith("boundaries.1.kind: expected one of") for text in found)


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


def test_a_solution_for_another_material(tables):
    tables["reference"] = {
        "exact": "steady-shock",
        "parameters": {"start": 300.0, "particle_speed": 1.0},
        "times": [0.01],
    }
    del tables["loads"]["manufactured"]
    assert any("reference.exact: expected a solution for the material" in text for text in faults_of(tables))
