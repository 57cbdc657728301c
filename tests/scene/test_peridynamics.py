"""Peridynamic scenes: each bad key gives one clear message; what is stated is what is meant."""

import copy

import numpy as np
import pytest

from parsolid.particles.generation import generate
from parsolid.particles.regions import selected
from parsolid.scene import SceneError, parse_scene

TERMS = [{"ratio": 9.0, "tau": 1.0}]
MATERIAL = {"kind": "prony", "density": 1000.0, "youngs_modulus": 7e6, "poissons_ratio": 0.3, "terms": TERMS}
PLATE = {
    "dimension": 2,
    "end_time": 10.0,
    "method": {"kind": "peridynamics"},
    "bodies": [
        {
            "shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 0.5]}},
            "particles": [10, 5],
            "placement": "cells",
            "material": MATERIAL,
        }
    ],
    "boundaries": [],
}


def plate(method=(), material=None, boundaries=(), dimension=2, **more):
    """A plate (bar, block) with changed tables."""
    data = copy.deepcopy(PLATE)
    data["method"] |= dict(method)
    body = data["bodies"][0]
    body["material"] = {**MATERIAL, **material} if material is not None else MATERIAL
    body["material"] = {key: value for key, value in body["material"].items() if value is not None}
    body["shape"] = {"box": {"lower": [0.0] * dimension, "upper": [1.0, 0.5, 0.5][:dimension]}}
    body["particles"] = [10, 5, 5][:dimension]
    data["boundaries"] = list(boundaries)
    return data | {"dimension": dimension} | more


PULL = {"kind": "traction", "plane": "X = 1", "traction": [1e6, 0.0]}
HELD = {"kind": "displacement", "plane": "X = 1", "displacement": ["0.1*t", "free"]}


def test_defaults_and_states_of_strain():
    method = parse_scene(plate()).method
    assert method.horizon(0.1) == pytest.approx(0.3015)
    assert (method.solution.kind, method.solution.safety, method.stabilisation.factor) == ("explicit", 0.8, 0.35)
    assert [method.state(dimension) for dimension in (1, 2, 3)] == ["bar", "plane-strain", "space"]
    assert parse_scene(plate({"plane": "stress"})).method.state(2) == "plane-stress"


def test_elastic_constants_of_a_material():
    material = (
        parse_scene(plate(material={"bulk": "elastic", "poissons_ratio": None, "bulk_modulus": 7e8})).bodies[0].material
    )
    before, after = material.instantaneous, material.equilibrium
    assert (before.youngs_modulus, after.youngs_modulus) == pytest.approx((7e7, 7e6))
    assert before.bulk_modulus == pytest.approx(after.bulk_modulus)
    for E, G, K, nu in (before, after):
        assert (3.0 * K * (1.0 - 2.0 * nu), 2.0 * G * (1.0 + nu)) == pytest.approx((E, E))
    shear = parse_scene(plate(material={"youngs_modulus": None, "shear_modulus": 2e6})).bodies[0].material
    assert shear.equilibrium.youngs_modulus == pytest.approx(5.2e6)
    assert shear.instantaneous.poissons_ratio == pytest.approx(0.3)


def test_maxwell_branches_stiffen_the_shear_alone():
    solid = {"kind": "neo-hookean", "terms": None, "branches": [{"modulus": 1e6, "tau": 1.0}]}
    material = parse_scene(plate(material=solid)).bodies[0].material
    before, after = material.instantaneous, material.equilibrium
    assert (after.youngs_modulus, after.poissons_ratio) == pytest.approx((7e6, 0.3), rel=1e-12)
    assert before.shear_modulus - after.shear_modulus == pytest.approx(1e6, rel=1e-9)
    # the first Lame constant stays
    lame = [one.bulk_modulus - 2.0 / 3.0 * one.shear_modulus for one in (before, after)]
    assert lame[0] == pytest.approx(lame[1], rel=1e-9)


ROWS = [[0.0, 0.0], [1.0, 2.0], [1.0, 5.0], [3.0, 5.0], [3.0, 0.0]]


@pytest.mark.parametrize("by_file", [False, True])
def test_histories_of_loads(by_file, tmp_path):
    table = {"rows": ROWS}
    if by_file:
        (tmp_path / "load.csv").write_text("time,factor\n" + "".join(f"{time},{factor}\n" for time, factor in ROWS))
        table = {"file": "load.csv"}
    scene = parse_scene(plate(boundaries=[PULL | {"history": table, "jumps": [2.0]}]), tmp_path)
    traction = scene.boundaries[0]
    assert traction.jump_times == [1.0, 2.0, 3.0]
    at = np.zeros((1, 2))
    sides = {0.0: (0.0, 0.0), 0.5: (1.0, 1.0), 1.0: (2.0, 5.0), 2.0: (5.0, 5.0), 3.0: (5.0, 0.0), 9.0: (0.0, 0.0)}
    for time, (before, after) in sides.items():
        values = [traction.prescribed.evaluate(at, time, side)[0, 0] for side in (True, False)]
        assert values == pytest.approx([before * 1e6, after * 1e6]), time


def test_formulas_that_jump():
    held = HELD | {"displacement": ["where(t < 2, 0.1, where(t <= 4, 0.2, 0.3))", "free"], "jumps": [2.0, 4.0]}
    prescribed = parse_scene(plate(boundaries=[held])).boundaries[0].prescribed
    at = np.zeros((1, 2))
    sides = {
        time: [prescribed.evaluate(at, time, before)[0, 0] for before in (True, False)] for time in (1.0, 2.0, 3.0, 4.0)
    }
    assert sides == {1.0: [0.1, 0.1], 2.0: [0.1, 0.2], 3.0: [0.2, 0.2], 4.0: [0.2, 0.3]}
    assert list(prescribed.free) == [False, True] and not prescribed.component(0).free[0]


def test_a_history_that_starts_with_a_load_jumps_there():
    scene = parse_scene(plate(boundaries=[PULL | {"history": {"rows": [[0.5, 1.0]]}}]))
    assert scene.boundaries[0].jump_times == [0.5]
    assert [scene.boundaries[0].history.factor(0.5, before) for before in (True, False)] == [0.0, 1.0]


def test_particles_of_a_layer(comm):
    scene = parse_scene(plate(boundaries=[{"kind": "layer", "plane": "X = 0.3", "side": "below"}]))
    particle_set = generate(scene, comm)
    chosen = selected(scene, scene.boundaries[0], particle_set, comm)
    assert np.array_equal(chosen, particle_set.position[:, 0] < 0.3)
    assert comm.allreduce(int(chosen.sum())) == 15
    scene = parse_scene(plate(boundaries=[{"kind": "layer", "plane": "X = -0.1", "side": "below"}]))
    with pytest.raises(SceneError, match="^boundaries.0: "):
        generate(scene, comm)


@pytest.mark.parametrize("dimension, plane", [(2, "stress"), (1, "strain")])
def test_hyperelastic_solids_know_no_free_thickness(dimension, plane):
    """They had the energy of plane strain."""
    solid = {"kind": "neo-hookean", "terms": None}
    method = {"plane": plane} if dimension == 2 else {}
    with pytest.raises(SceneError, match=r"^bodies.0.material.kind: "):
        parse_scene(plate(method, solid, dimension=dimension))
    assert parse_scene(plate({"plane": "strain"}, solid))
