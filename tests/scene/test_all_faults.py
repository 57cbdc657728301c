"""Scenes with several faults at once: every one is told, with its key, and nothing else is."""

import copy
import random

import pytest
from plain_tables import MATERIAL
from small_scenes import changed

from parsolid.scene import SceneError, parse_scene


def box(lower, upper):
    return {"box": {"lower": lower, "upper": upper}}


SCENE = {
    "title": "two blocks",
    "dimension": 3,
    "end_time": 1.0,
    "method": {"kind": "tlsph"},
    "bodies": [
        {
            "name": name,
            "shape": box([0.0, 0.0, z], [1.0, 1.0, z + 1.0]),
            "particles": [5] * 3,
            "material": dict(MATERIAL),
        }
        for name, z in (("low", 0.0), ("high", 1.25))
    ],
    "regions": [{"name": "core", "shape": box([0.3, 0.3, 0.3], [0.7, 0.7, 0.7])}],
    "boundaries": [
        {"kind": "fixed", "plane": "Z = 0", "body": "low"},
        {"kind": "roller", "plane": "X = 0", "body": "low"},
        {"kind": "traction", "plane": "Z = 2.25", "traction": ["0", "0", "-1e3*t"]},
    ],
    "initial": [{"body": "high", "velocity": ["0", "0", "-1"]}],
    "contact": [{"bodies": ["low", "high"], "friction": 0.1}],
    "tools": [{"name": "floor", "shape": {"plane": {"point": [0.0, 0.0, -1.0], "normal": [0.0, 0.0, 1.0]}}}],
    "probes": [
        {"name": "corner", "at": [1.0, 1.0, 1.0], "fields": ["velocity"]},
        {"name": "core", "where": "core", "fields": ["pressure"]},
        {"name": "all", "quantity": "linear_momentum"},
    ],
    "output": {"fields_interval": 0.1, "history_steps": 2},
    "reference": {"final": {"kinetic": 1.0}},
}

# of each table of the scene: changes, the key at fault, the code
FAULTS = [
    [({"title": 3}, "title", "type"), ({"title": None, "titel": "x"}, "titel", "unknown-key")],
    [({"output.fields_interval": 1e-9}, "output.fields_interval", "refused"), ({"end_time": "x"}, "end_time", "type")],
    [
        ({"method.cfl": -1.0}, "method.cfl", "bound"),
        ({"method.smoothin": 1.0}, "method.smoothin", "unknown-key"),
        ({"method.integrator": "leapfog"}, "method.integrator", "choice"),
        ({"method.reconstruction": "yes"}, "method.reconstruction", "type"),
    ],
    [
        ({"bodies.0.material.density": -1.0}, "bodies.0.material.density", "bound"),
        ({"bodies.0.material.denstiy": 1.0}, "bodies.0.material.denstiy", "unknown-key"),
        ({"bodies.0.velocity": ["Q", "0", "0"]}, "bodies.0.velocity.0", "formula"),
        ({"bodies.0.jitter": 0.5}, "bodies.0.jitter", "bound"),
    ],
    [
        ({"bodies.1.velocity": ["0", "0"]}, "bodies.1.velocity", "length"),
        ({"bodies.1.spacing": 0.1}, "bodies.1", "exclusive"),
        ({"bodies.1.placement": "corners"}, "bodies.1.placement", "choice"),
    ],
    [({"regions.0.shape": None}, "regions.0", "exclusive"), ({"regions.0.side": "on"}, "regions.0.side", "refused")],
    [
        ({"boundaries.0.kind": "fixd"}, "boundaries.0.kind", "choice"),
        ({"boundaries.0.body": "lower"}, "boundaries.0.body", "unknown-name"),
        ({"boundaries.0.plane": "Z = 0.4"}, "boundaries.0.plane", "elsewhere"),
        ({"boundaries.0.mirrored": True}, "boundaries.0.mirrored", "unknown-key"),
    ],
    [
        ({"boundaries.1.plane": "Q = 0"}, "boundaries.1.plane", "refused"),
        ({"boundaries.1.plane": None}, "boundaries.1", "exclusive"),
        ({"boundaries.1.where": "nowhere", "boundaries.1.plane": None}, "boundaries.1.where", "unknown-name"),
        ({"boundaries.1.reaction": True}, "boundaries.1.reaction", "refused"),
    ],
    [({"boundaries.2.traction": None}, "boundaries.2.traction", "missing")],
    [
        ({"initial.0.body": "top"}, "initial.0.body", "unknown-name"),
        ({"initial.0.velocity": 1}, "initial.0.velocity", None),
    ],
    [
        ({"contact.0.bodies": ["low", "hgih"]}, "contact.0.bodies", "unknown-name"),
        ({"contact.0.friction": -0.1}, "contact.0.friction", "bound"),
    ],
    [
        ({"tools.0.bodies": ["lo"]}, "tools.0.bodies.0", "unknown-name"),
        ({"tools.0.stiffness": 1e9}, "tools.0.stiffness", "bound"),
    ],
    [
        ({"probes.0.fields": ["velocty"]}, "probes.0.fields.0", "unknown-name"),
        ({"probes.0.name": "a.b"}, "probes.0.name", None),
        ({"probes.0.at": [1.0, 1.0]}, "probes.0.at", "length"),
    ],
    [({"probes.2.name": "core"}, "probes.2.name", "repeated"), ({"probes.2.fields": ["pressure"]}, "probes.2", None)],
    [
        ({"loads": {"manufactured": True}}, "loads.manufactured", "refused"),
        ({"loads.gravity": 1}, "loads.gravity", None),
    ],
    [({"reference.final": {"kinetik": 1.0}}, "reference.final.kinetik", "unknown-name")],
    [
        ({"bond": [{"bodies": ["low", "hgih"]}]}, "bond.0.bodies", "unknown-name"),
        ({"tie": [{"bodies": ["lo", "high"]}]}, "tie.0.bodies", "unknown-name"),
    ],
]


@pytest.mark.parametrize("seed", range(60))
def test_every_fault_is_told_at_once(seed):
    chance = random.Random(seed)
    drawn = [chance.choice(one) for one in chance.sample(FAULTS, chance.randint(1, 5))]
    scene = copy.deepcopy(SCENE)
    for changes, *_ in drawn:
        scene = changed(scene, changes)
    with pytest.raises(SceneError) as caught:
        parse_scene(scene)
    told = {one.key: one.code for one in caught.value.faults}
    assert told.keys() == {key for _, key, _ in drawn}
    assert all(code in (None, told[key]) for _, key, code in drawn)


def test_a_mesh_that_is_not_there_makes_no_other_fault():
    mesh = {"bodies.0.shape": {"mesh": {"file": "none.msh"}}, "bodies.0.particles": None, "title": 3}
    scene = changed(SCENE, mesh | {"method.weights": "mesh", "boundaries.1": {"kind": "fixed", "where": "a group"}})
    with pytest.raises(SceneError) as caught:
        parse_scene(scene)
    assert {one.key for one in caught.value.faults} == {"title", "bodies.0.shape.mesh.file"}


def test_a_body_that_is_elsewhere_hides_no_fault_of_a_stage():
    stage = {"start": 0.5, "method": {"integrator": "leapfog"}}
    with pytest.raises(SceneError) as caught:
        parse_scene(changed(SCENE, {"stages": [stage], "bodies.0.shape.box.upper": [1.0, 1.0, -1.0]}))
    assert {one.key for one in caught.value.faults} == {"stages.0.method.integrator", "bodies.0.shape.box.upper.2"}


def test_a_key_that_a_material_lacks_is_told_beside_its_other_faults():
    flow = {"kind": "linear-hardening", "yield": 1e8}
    metal = {"kind": "elastic-plastic", "density": -1.0, "youngs_modulus": 70e9, "flow_stress": flow}
    with pytest.raises(SceneError) as caught:
        parse_scene(changed(SCENE, {"bodies.0.material": metal}))
    of_flow = {f"bodies.0.material.flow_stress.{key}" for key in ("yield", "yield_stress")}
    assert {one.key for one in caught.value.faults} == {
        *("bodies.0.material.density", "bodies.0.material.specific_heat"),
        *of_flow,
    }


def test_what_is_at_fault_hides_what_depends_on_it():
    scene = changed(SCENE, {"bodies.0.material.kind": "rubber", "reference.final": {"kinetik": 1.0}, "title": 3})
    with pytest.raises(SceneError) as caught:
        parse_scene(scene)
    assert [one.key for one in caught.value.faults] == ["title", "bodies.0.material.kind"]
