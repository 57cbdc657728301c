"""Scenes that are sound: defaults, computed values, overrides, and the way to TOML and back."""

import pickle
from pathlib import Path

import numpy as np
import pytest

from parsolid.particles.fillings import filling_of
from parsolid.scene import dump_scene, load_scene, packaged_scene, parse_scene
from parsolid.scene.base_model import Plane
from parsolid.scene.checks import plane_side
from parsolid.scene.raw_tables import override_value

RUNS = Path(__file__).parents[2] / "runs" / "tlsph"
SCENES = [*sorted(RUNS.glob("*.toml")), packaged_scene()]


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_round_trip(path, tmp_path):
    scene = load_scene(path)
    dump_scene(scene, tmp_path / "scene.toml")
    assert load_scene(tmp_path / "scene.toml") == scene
    assert pickle.loads(pickle.dumps(scene)) == scene


def test_the_run_without_arguments_is_the_column_of_the_runs():
    packaged, own = load_scene(packaged_scene()).resolved(), load_scene(RUNS / "column.toml").resolved()
    assert packaged["output"].pop("directory") == "results/twisting_column"
    assert own["output"].pop("directory") == "results/column"
    assert packaged == own


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
    square["bodies"][0]["material"] = {
        "kind": "mooney-rivlin",
        "density": 1.0,
        "xi": 2.0,
        "zeta": 1.0,
        "lambda_hat": 7.0,
    }
    moduli = parse_scene(square).bodies[0].material.moduli
    assert (moduli.xi, moduli.zeta, moduli.lambda_hat, moduli.shear_modulus, moduli.first_lame) == (
        2.0,
        1.0,
        7.0,
        6.0,
        11.0,
    )


def test_neo_hookean_and_branches_without_stiffness(square):
    square["bodies"][0]["material"] |= {"kind": "neo-hookean", "branches": [{"beta": 0, "tau": 1.0}]}
    material = parse_scene(square).bodies[0].material
    assert material.moduli.zeta == 0.0 and material.branch_moduli == () and material.relaxation_times == ()


def test_overrides_come_before_validation(tmp_path):
    scene = load_scene(
        packaged_scene(),
        [
            "bodies.0.particles=[5,25,5]",
            "method.kernel=cubic-spline",
            "bodies.0.material.branches=[]",
            "loads.acceleration=[0,-9.81,0]",
        ],
    )
    assert scene.bodies[0].particles == [5, 25, 5] and scene.method.kernel == "cubic-spline"
    assert scene.bodies[0].material.branches == []
    np.testing.assert_array_equal(scene.loads.acceleration.evaluate(np.zeros((1, 3))), [[0.0, -9.81, 0.0]])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("3", 3),
        ("0.5", 0.5),
        (".5", 0.5),
        ("-5.e-3", -5e-3),
        (".", "."),
        ("true", True),
        ("[1, 2]", [1, 2]),
        ('"3"', "3"),
        ("Y = 0", "Y = 0"),
        ("a\nb = 1", "a\nb = 1"),
        ("1\nb = 1", "1\nb = 1"),
    ],
)
def test_override_values(text, value):
    assert override_value(text) == value


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
    scene = load_scene(RUNS / "punch.toml", ["reference.series=reference/punch_b0.json"])
    assert scene.reference.series == str((RUNS / "reference" / "punch_b0.json").resolve())
