"""Scenes of `runs/` changed at random, read in this process: a scene or a message, never anything else."""

import copy
import random
import sys
from pathlib import Path

import pytest

from parsolid.scene import SceneError, parse_scene

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "end_to_end")]

from mutations import mutated  # noqa: E402

from checks.scene_attack import shipped  # noqa: E402

SCENES = shipped()


@pytest.mark.parametrize("seed", range(4))
def test_a_changed_scene_is_read_or_refused(seed):
    chance = random.Random(seed)
    read, refused = 0, []
    for _ in range(50):
        name = chance.choice(sorted(SCENES))
        scene = mutated(SCENES[name], chance)
        try:
            parse_scene(scene, (ROOT / name).parent)
            read += 1
        except SceneError as error:
            refused.append(str(error).strip())
    assert 0 < read < 50 and all(refused)


def of(name: str, **changes: object) -> dict:
    """Tables of a scene of `runs/`, one of its values, named by its path, replaced."""
    scene = copy.deepcopy(SCENES[name])
    for path, value in changes.items():
        *keys, last = path.split("__")
        place = scene
        for key in keys:
            place = place[int(key) if key.isdigit() else key]
        place[last] = value
    return scene


def test_a_number_or_a_table_in_its_place():
    for sound in (False, {"linear": 0.5}):
        scene = parse_scene(of("runs/ulsph/taylor.toml", method__viscosity=sound), ROOT / "runs" / "ulsph")
        assert parse_scene(scene.resolved()).method == scene.method


def test_a_boundary_at_no_body_beside_a_fault_of_another():
    scene = of("runs/mpm/taylor.toml")
    scene["boundaries"].append({"kind": "traction", "plane": "X = 1", "traction": ["1e5", "0"]})
    with pytest.raises(SceneError, match="boundaries.[0-9]"):
        parse_scene(scene, ROOT / "runs" / "mpm")


@pytest.mark.parametrize("name", ["tools/incline", "contact/incline", "contact/friction_heat"])
def test_a_reference_beside_friction_names_columns_of_the_history(name):
    scene = of(f"runs/{name}.toml") | {"reference": {"final": {"kinetic": 1.0, "friction_dissipation": 1.0}}}
    folder, wanted = (ROOT / "runs" / name).parent, scene["reference"]["final"]
    assert parse_scene(scene, folder).reference.final == wanted
    wanted["friction_heat"] = 1.0
    if scene["bodies"][0]["material"]["kind"] == "elastic-plastic":
        assert parse_scene(scene, folder).reference.final == wanted
    else:
        with pytest.raises(SceneError, match="reference.final.friction_heat"):
            parse_scene(scene, folder)
