"""Scenes that are sound: defaults, computed values, overrides, and the way to TOML and back."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from plain_tables import MATERIAL

from parsolid.exact import SOLUTIONS
from parsolid.particles.fillings import filling_of
from parsolid.scene import dump_scene, load_scene, packaged_scene, parse_scene
from parsolid.scene.base_model import Plane
from parsolid.scene.checks import plane_side
from parsolid.scene.raw_tables import override_value

RUNS = Path(__file__).parents[2] / "runs"
SCENES = [
    packaged_scene(),
    *(path for kind in ("tlsph", "mpm", "peridynamics") for path in sorted(RUNS.glob(f"{kind}/*.toml"))),
]


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_round_trip(path, tmp_path):
    """Through TOML and between ranks; a reference can be made where one is named."""
    scene = load_scene(path)
    dump_scene(scene, tmp_path / "scene.toml")
    assert load_scene(tmp_path / "scene.toml") == scene
    assert pickle.loads(pickle.dumps(scene)) == scene
    if scene.reference is not None and scene.reference.exact is not None:
        solution = SOLUTIONS[scene.reference.exact].of_scene(scene)
        assert solution.scales if scene.reference.each_step else solution.error_names(scene.dimension)


@pytest.mark.parametrize("name, X", [("axis_aligned", [[0.2, 0.7]]), ("vortex", [[0.7, -0.6]])])
def test_initial_velocities_of_manufactured_runs_are_those_of_the_exact_solution(name, X):
    scene = load_scene(RUNS / "mpm" / f"{name}.toml")
    expected = SOLUTIONS[scene.reference.exact].of_scene(scene).fields(np.array(X), 0.0)["velocity"]
    np.testing.assert_allclose(scene.bodies[0].velocity.evaluate(np.array(X)), expected, rtol=1e-12)


def test_defaults(square):
    scene = parse_scene(square)
    method = scene.method
    assert (method.kernel, method.smoothing, method.dissipation_of("kernel")) == ("wendland-c2", 0.85, 1.0)
    assert (method.integrator, method.safety, method.cfl) == ("leapfrog", 0.9, None)
    assert method.reconstruction is True and method.maximum_step is None
    assert scene.bodies[0].placed_on == "vertices" and scene.bodies[0].material.branches == []
    assert scene.output.checkpoint_wall == 600.0 and scene.output.history_steps is None


def test_lame_constants_from_engineering_constants(square):
    square["bodies"][0]["material"] |= {
        "zeta": 1e6,
        "branches": [{"beta": 0.5, "tau": 0.1}, {"modulus": 3e5, "tau": 2.0}],
    }
    material = parse_scene(square).bodies[0].material
    moduli = material.moduli
    mu = 17e6 / 2.9
    lame = 17e6 * 0.45 / (1.45 * 0.1)
    assert moduli.shear_modulus == pytest.approx(mu, rel=1e-14)
    assert 2.0 * (moduli.xi + moduli.zeta) == pytest.approx(mu, rel=1e-14)
    assert moduli.lambda_hat + 4.0 * moduli.zeta == pytest.approx(lame, rel=1e-14)
    assert moduli.bulk_modulus == pytest.approx(17e6 / (3.0 * 0.1), rel=1e-13)
    assert material.branch_moduli == pytest.approx((0.5 * mu, 3e5), rel=1e-14)
    assert material.relaxation_times == (0.1, 2.0)


def test_constants_of_the_law_given_directly(square):
    constants = {"xi": 2.0, "zeta": 1.0, "lambda_hat": 7.0}
    square["bodies"][0]["material"] = {"kind": "mooney-rivlin", "density": 1.0, **constants}
    moduli = parse_scene(square).bodies[0].material.moduli
    assert (moduli.xi, moduli.zeta, moduli.lambda_hat) == (2.0, 1.0, 7.0)
    assert (moduli.shear_modulus, moduli.first_lame) == (6.0, 11.0)
    square["bodies"][0]["material"] = MATERIAL | {"kind": "neo-hookean", "branches": [{"beta": 0, "tau": 1.0}]}
    material = parse_scene(square).bodies[0].material
    assert material.moduli.zeta == 0.0 and material.branch_moduli == () and material.relaxation_times == ()


def test_overrides_come_before_validation():
    changes = ["bodies.0.particles=[5,25,5]", "method.kernel=cubic-spline", "loads.acceleration=[0,-9.81,0]"]
    scene = load_scene(packaged_scene(), changes)
    assert scene.bodies[0].particles == [5, 25, 5] and scene.method.kernel == "cubic-spline"
    np.testing.assert_array_equal(scene.loads.acceleration.evaluate(np.zeros((1, 3))), [[0.0, -9.81, 0.0]])


def test_override_values():
    read = {"3": 3, "0.5": 0.5, ".5": 0.5, "-5.e-3": -5e-3, ".": ".", "true": True, "[1, 2]": [1, 2], '"3"': "3"}
    read |= dict.fromkeys(("Y = 0", "a\nb = 1", "1\nb = 1"))
    for text, value in read.items():
        assert override_value(text) == (text if value is None else value)


def test_fields_times(square):
    scene = parse_scene(square)
    assert len(scene.fields_times) == 21 and scene.fields_times[0] == 0.0 and scene.fields_times[-1] == 1.0
    square["output"] = {"fields_interval": 0.3}
    assert parse_scene(square).fields_times == pytest.approx([0.0, 0.3, 0.6, 0.9, 1.0])
    square["output"] = {"fields_times": [0.2, 0.5, 3.0]}
    assert parse_scene(square).fields_times == [0.2, 0.5, 1.0]


def test_planes(square):
    assert Plane.parse("Y = 0") == Plane(1, 0.0) and Plane.parse(" X=-0.5e1 ") == Plane(0, -5.0)
    filling = filling_of(parse_scene(square).bodies[0], 2)
    assert [plane_side(Plane(1, y), filling) for y in (0.0, 2.0, 1.0)] == [-1, 1, 0]


def test_probe_columns(cube):
    cube["probes"] = [
        {"name": "p", "at": [0.0, 0.0, 0.0], "fields": ["displacement", "twist"], "axis": "Z"},
        {"name": "all", "quantity": "linear_momentum"},
    ]
    first, second = parse_scene(cube).probes
    assert first.columns(3) == ["p.displacement_x", "p.displacement_y", "p.displacement_z", "p.twist"]
    assert second.columns(3) == ["all.linear_momentum_x", "all.linear_momentum_y", "all.linear_momentum_z"]


def test_files_are_relative_to_the_scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = load_scene(RUNS / "tlsph" / "punch.toml", ["reference.series=reference/punch_b0.json"])
    assert scene.reference.series == str((RUNS / "tlsph/reference/punch_b0.json").resolve())
