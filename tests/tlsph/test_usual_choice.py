"""Weights of scenes that state none: those that every table confirms, and nowhere else."""

import json
from pathlib import Path

import meshio
import numpy as np
import pytest
from solids import SOFT

from parsolid.campaign.cases import cases_of, load_study
from parsolid.campaign.variants import coarse_variants
from parsolid.methods.tlsph.body_weights import weights_of_bodies
from parsolid.scene import load_scene, parse_scene

pytestmark = pytest.mark.serial
RUNS = Path(__file__).parents[2] / "runs"


def tables(particles=(8, 9), body=None, method=None, **rest):
    shape = {"box": {"lower": [0.0] * len(particles), "upper": [1.0] * len(particles)}}
    one = {"name": "one", "shape": shape, "particles": list(particles), "material": SOFT, **(body or {})}
    kind = {"kind": "tlsph", **(method or {})}
    return {"dimension": len(particles), "end_time": 1e-3, "method": kind, "bodies": [one], **rest}


def choice(data):
    settings = parse_scene(data).systems[0].settings
    return settings.pair_weights, settings.integrator, settings.cfl, settings.safety


@pytest.mark.parametrize("stated", [{}, {"integrator": "leapfrog"}, {"dissipation": 0.5, "maximum_step": 1e-4}])
def test_resolved_boxes_have_weights_that_close(stated):
    assert choice(tables(method=stated)) == ("best", "leapfrog", None, 0.9)
    assert choice(tables((4, 8, 8), method=stated | {"safety": 0.5})) == ("best", "leapfrog", None, 0.5)


@pytest.mark.parametrize(
    "data",
    [
        tables((3, 9)),
        tables((4, 9), boundaries=[{"plane": "X = 0", "kind": "roller"}]),
        tables((9, 9, 3)),
        tables(body={"placement": "cells"}),
        tables(body={"jitter": 0.1}),
        tables(body={"shape": {"sphere": {"centre": [0, 0], "radius": 1}}, "particles": None, "spacing": 0.1}),
        tables(method={"reference": "updated", "update_every": 5}),
        tables(method={"kernel": "wendland-c2"}),
        tables(method={"smoothing": 0.85}),
        tables(method={"weights": "kernel"}),
        tables(method={"reconstruction": False}),
    ],
    ids=lambda data: str({key: data[key] for key in ("method", "bodies", "tools") if key in data})[:120],
)
def test_elsewhere_the_kernel_stays(data):
    data["bodies"] = [{key: value for key, value in body.items() if value is not None} for body in data["bodies"]]
    assert choice(data) == ("kernel", "leapfrog", None, 0.9)


def test_three_stages_have_the_weights_of_the_paper():
    assert choice(tables(method={"integrator": "ssp-rk3"})) == ("kernel", "ssp-rk3", 0.7, None)
    assert choice(tables(method={"integrator": "ssp-rk3", "cfl": 0.3})) == ("kernel", "ssp-rk3", 0.3, None)


def test_bodies_that_touch_keep_the_kernel_and_those_apart_do_not():
    def pair(gap):
        data = tables()
        other = json.loads(json.dumps(data["bodies"][0])) | {"name": "other"}
        other["shape"]["box"] = {"lower": [1.0 + gap, 0.0], "upper": [2.0 + gap, 1.0]}
        bond = [] if gap else [{"bodies": "all"}]
        return choice(data | {"bodies": [*data["bodies"], other], "bond": bond})

    assert pair(0.0)[0] == "kernel" and pair(3.0)[0] == "best"


def test_what_is_written_states_it_so_that_coarse_runs_and_restarts_have_the_same():
    scene = parse_scene(tables((13, 13)))
    again = parse_scene(scene.resolved())
    assert again.resolved() == scene.resolved() and again.resolved()["method"]["weights"] == "best"
    coarse = [one.scene for one in coarse_variants(scene, False)[0]]
    assert min(one.bodies[0].particles[0] for one in coarse) < 8
    assert {one.systems[0].settings.pair_weights for one in coarse} == {"best"}


def test_check_says_so():
    scene = parse_scene(tables())
    notes = scene.systems[0].settings.choices(scene, (0,))
    assert [one.code for one in notes] == ["chosen-weights"]
    stated = parse_scene(tables(method={"weights": "best"}))
    assert stated.systems[0].settings.choices(stated, (0,)) == []


def settings_of_study(folder, more: dict[int, str]) -> list:
    """Settings of the runs of a study of a block with so many particles along its sides, and what else is set."""
    lines = ["dimension = 2", "end_time = 1e-3", 'method = { kind = "tlsph" }', "[[bodies]]", "particles = [5, 5]"]
    lines += ["shape = { box = { lower = [0, 0], upper = [1, 1] } }", "[bodies.material]"]
    lines += [f"{key} = {json.dumps(value)}" for key, value in SOFT.items()]
    (folder / "block.toml").write_text("\n".join(lines))
    runs = [
        f'{{ label = "{n}", spacing = {1 / n}, set = ["bodies.0.particles=[{n}, {n}]"{words}] }},'
        for n, words in more.items()
    ]
    study = ['title = "B"', "[[series]]", 'name = "b"', 'scene = "block.toml"', "[[series.axes]]", 'name = "particles"']
    (folder / "study.toml").write_text("\n".join([*study, "settings = [", *runs, "]"]))
    return [case.scene.systems[0].settings for case in cases_of(load_study(folder / "study.toml"))]


def test_a_study_does_not_change_its_method_between_two_resolutions(tmp_path):
    found = settings_of_study(tmp_path, {5: "", 7: "", 9: ""})
    assert {(one.pair_weights, one.integrator) for one in found} == {("best", "leapfrog")}


def test_a_resolution_of_a_study_that_states_its_step_keeps_what_it_has(tmp_path):
    coarse, fine = settings_of_study(tmp_path, {5: ', "method.safety=0.3"', 9: ""})
    assert (coarse.safety, fine.safety) == (0.3, 0.9)


def of_mesh(tmp_path, method=None, bodies=1, **body):
    """A scene of bodies from one mesh."""
    meshio.write(tmp_path / "m.vtu", meshio.Mesh(np.eye(3)[[2, 0, 1]] - [0, 0, 1.0], [("triangle", [[0, 1, 2]])]))
    data = tables(method=method)
    one = {"shape": {"mesh": {"file": str(tmp_path / "m.vtu")}}, "material": SOFT, **body}
    data["bodies"] = [{"name": f"body-{i}", **one} for i in range(bodies)]
    return data


def chosen(data):
    """Weights of the bodies of the only method, its integrator, and the dissipation of bodies from meshes."""
    settings = parse_scene(data).systems[0].settings
    scene = parse_scene(parse_scene(data).resolved())
    assert weights_of_bodies(scene.systems[0].settings.pair_weights, scene) == weights_of_bodies(
        settings.pair_weights, parse_scene(data)
    )
    return weights_of_bodies(settings.pair_weights, scene), settings.integrator, settings.dissipation_of("mesh")


@pytest.mark.parametrize("bodies", [1, 2])
def test_bodies_from_meshes_have_the_weights_of_their_elements(tmp_path, bodies):
    assert chosen(of_mesh(tmp_path, bodies=bodies)) == (["mesh"] * bodies, "leapfrog", 0.1)
    assert chosen(of_mesh(tmp_path, {"dissipation": 0.5}, bodies)) == (["mesh"] * bodies, "leapfrog", 0.5)
    assert chosen(of_mesh(tmp_path, {"weights": "mesh"}, bodies)) == (["mesh"] * bodies, "leapfrog", 0.1)
    assert chosen(of_mesh(tmp_path, {"weights": "best"}, bodies)) == (["mesh"] * bodies, "leapfrog", 0.1)


@pytest.mark.parametrize(("particles", "weights"), [((4, 8), "fourth-order"), ((3, 8), "kernel")])
def test_boxes_beside_meshes_have_what_they_have_alone(tmp_path, particles, weights):
    data, beside = of_mesh(tmp_path), tables(particles)["bodies"][0]
    beside["shape"] = {"box": {"lower": [5.0, 5.0], "upper": [6.0, 6.0]}}
    data["bodies"].append(beside)
    assert chosen(data)[0] == ["mesh", weights]
    data["contact"] = [{"bodies": [one["name"] for one in data["bodies"]]}]
    assert chosen(data)[0] == ["mesh", weights]


BALL = {"shape": {"sphere": {"centre": [1.6, 0.5], "radius": 0.5}}, "spacing": 0.1}
SECOND = {"shape": {"box": {"lower": [1.0, 0.0], "upper": [2.0, 1.0]}}, "placement": "vertices"}
DISC = {"name": "disc", "shape": {"sphere": {"centre": [0.5, 1.6], "radius": 0.5}}, "mass": 1.0}
FLOOR = {"name": "floor", "shape": {"plane": {"point": [0.0, -0.1], "normal": [0.0, 1.0]}}}
MEETS = {
    "a box": ([SECOND | {"particles": [9, 9]}], {"contact": [{"bodies": ["one", "other"]}]}),
    "a ball": ([BALL], {"contact": [{"bodies": ["one", "other"]}]}),
    "a tool": ([], {"tools": [FLOOR]}),
    "a tool with mass": ([], {"tools": [DISC]}),
    "bars that a bond joins far away": (
        [{"shape": {"box": {"lower": [x, 9.0], "upper": [x + 1.0, 10.0]}}, "particles": [8, 8]} for x in (0.0, 1.0)],
        {"bond": [{"bodies": ["other", "other-2"]}]},
    ),
}


@pytest.mark.parametrize("meets", MEETS)
def test_a_body_has_the_same_weights_whatever_it_meets(meets):
    others, more = MEETS[meets]
    data = tables(**more)
    names = ("other", "other-2")
    data["bodies"] += [{"name": name, "material": SOFT, **other} for name, other in zip(names, others)]
    kinds = chosen(data)[0]
    assert kinds[0] == ("kernel" if meets == "a tool with mass" else "fourth-order")
    assert kinds[1:] == (["fourth-order"] if meets == "a box" else ["kernel"] * len(others))


@pytest.mark.parametrize("offset, weights", [(0.0, "best"), (0.05, "kernel"), (0.5, "best")])
def test_a_mirror_plane_beside_the_nodes_keeps_the_kernel(offset, weights):
    """Weights in closed form have images at planes through nodes alone; this one bounds the first of two boxes."""
    data = tables((9, 9), boundaries=[{"plane": "X = 0", "kind": "roller"}])
    shape = {"box": {"lower": [offset, 3.0], "upper": [1.0 + offset, 4.0]}}
    data["bodies"].append(data["bodies"][0] | {"name": "other", "shape": shape})
    assert choice(data)[0] == weights


def test_meshes_of_one_of_several_methods_have_them_too(tmp_path):
    data = of_mesh(tmp_path, bodies=2)
    data["methods"] = [data.pop("method") | {"name": "first"}, {"name": "second", "kind": "peridynamics"}]
    for body, name in zip(data["bodies"], ("first", "second")):
        body["method"] = name
    first = parse_scene(data).systems[0].settings
    assert first.pair_weights == "mesh"


@pytest.mark.parametrize(
    "change",
    [
        {"method": {"kernel": "wendland-c2"}},
        {"method": {"weights": "kernel"}},
        {"method": {"integrator": "ssp-rk3"}},
        {"method": {"reference": "updated", "update_every": 5}},
        {"placement": "cells"},
        {"jitter": 0.1},
        {"deformation_gradient": [["1.1", "0"], ["0", "1"]]},
    ],
    ids=str,
)
def test_what_was_not_confirmed_with_weights_of_meshes_has_the_kernel(tmp_path, change):
    settings = parse_scene(of_mesh(tmp_path, **change)).method
    assert (settings.pair_weights, settings.dissipation_of("kernel")) == ("kernel", 1.0)


def test_best_may_be_stated_where_other_methods_have_bodies():
    scene = load_scene(RUNS / "mixed" / "bars.toml", ["methods.0.weights=best"])
    first = scene.systems[0]
    assert "smoothing" in first.settings.ignored_keys(scene, first.bodies)
    assert "fixed_walls" not in first.settings.energy_terms(scene, first.bodies)
