"""Scenes of several methods: what a file may say, what it means for each system, and what is refused, by its key."""

import copy
import pickle
from pathlib import Path

import pytest
from mixed.bodies_apart import COPPER, METHODS, mixed, tables
from mpi4py import MPI

from parsolid.api.check_advice import scene_advice
from parsolid.collective import SolverError
from parsolid.scene import SceneError, dump_scene, load_scene, parse_scene
from parsolid.simulation.energy_check import EnergyLimits
from parsolid.simulation.ledger import names_of_terms, terms_of
from parsolid.simulation.loop import Simulation
from parsolid.simulation.restart import contents
from parsolid.simulation.scene_changes import changes, faults_and_notes

PAIR = ("soft", "metal")


def faults(change, names=PAIR) -> list[str]:
    """What is said of tables after a change to them."""
    data = tables(names)
    change(data)
    with pytest.raises(SceneError) as error:
        parse_scene(data)
    return error.value.faults


def test_a_scene_says_which_body_has_which_method(tmp_path):
    scene = mixed()
    assert [(one.name, one.bodies, one.settings.kind) for one in scene.systems] == [
        (name, (number,), METHODS[name]["kind"]) for number, name in enumerate(METHODS)
    ]
    part = scene.part(scene.systems[2])
    assert part.method.kind == "mpm" and part.methods is None and [body.name for body in part.bodies] == ["metal"]
    dump_scene(scene, tmp_path / "scene.toml")
    assert load_scene(tmp_path / "scene.toml", ["output.directory=results"]).bodies == scene.bodies
    assert parse_scene(scene.resolved()) == pickle.loads(pickle.dumps(scene)) == scene


def test_one_of_several_methods_need_not_be_named():
    data = tables(("soft",))
    del data["bodies"][0]["method"]
    (system,) = parse_scene(data).systems
    assert system.settings.kind == "tlsph" and system.bodies == (0,)


def test_a_boundary_is_for_the_bodies_in_its_region():
    data = tables(PAIR)
    named = {"plane": "X = 7", "kind": "fixed", "body": "metal"}
    box = {"box": {"lower": [6.2, 0.0], "upper": [9.0, 1.0]}, "kind": "velocity", "velocity": ["1", "free"]}
    ball = {"ball": {"centre": [-0.3, 0.5], "radius": 0.4}, "kind": "velocity", "velocity": ["1", "free"]}
    hot = {"plane": "X = 6", "kind": "temperature", "temperature": "300"}
    pull = {"plane": "X = 1", "kind": "traction", "traction": ["1", "0"]}
    data["boundaries"] += [{"plane": "X = 0", "kind": "fixed"}, named, box, ball, hot, pull]
    data["bodies"][1]["material"] = COPPER | {"conductivity": 300.0}
    scene = parse_scene(data | {"loads": {"acceleration": [0.0, -9.81], "heat_source": "1e3"}})
    soft, metal = (scene.part(system) for system in scene.systems)
    assert [one.kind for one in soft.boundaries] == ["roller", "fixed", "velocity", "traction"]
    assert [one.kind for one in metal.boundaries] == ["roller", "fixed", "velocity", "temperature"]
    assert soft.boundaries[2].ball is not None and metal.boundaries[2].box is not None
    assert soft.loads.heat_source is None and metal.loads.heat_source.source == "1e3"
    assert soft.loads.acceleration == metal.loads.acceleration == scene.loads.acceleration
    assert scene_advice(scene) == []
    wall = [{"plane": "Y = 9", "side": "below", "kind": "wall"}]
    (note,) = scene_advice(parse_scene(tables(PAIR, boundaries=wall)))
    assert note.code == "boundary-without-effect" and "boundaries.0" in note.text and "bodies.0" in note.text


def test_a_support_tells_its_force_where_its_own_method_can():
    """A plane of a grid cannot; another method's body does not concern it."""
    held = {"plane": "X = 0", "kind": "fixed", "mirror": False, "name": "foot", "reaction": True}
    scene = parse_scene(tables(PAIR, boundaries=[held]))
    assert scene.boundaries[0].reports == "foot"
    assert parse_scene(tables(PAIR, boundaries=[held | {"body": "soft"}])).boundaries[0].reports == "foot"
    told = faults(lambda data: data["boundaries"].append(held | {"plane": "X = 7", "mirror": True, "body": "metal"}))
    assert [one.key for one in told] == ["boundaries.1.reaction"]


def test_one_method_for_all_bodies_takes_no_name():
    data = tables(("soft",))
    (method,) = data.pop("methods")
    with pytest.raises(SceneError, match="expected one of kind, .*found the unknown key 'name'"):
        parse_scene(data | {"method": method})
    del method["name"]
    with pytest.raises(SceneError, match="bodies.0.method: expected no such key where all bodies have one method"):
        parse_scene(data | {"method": method})
    del data["bodies"][0]["method"]
    assert "methods" not in parse_scene(data | {"method": method}).resolved()


def test_what_a_system_finds_wrong_is_told_in_the_keys_of_the_whole_scene():
    data = tables(PAIR, boundaries=[{"plane": "X = 0", "kind": "fixed"}, {"plane": "X = 7.0", "kind": "roller"}])
    data["methods"][1]["cell"] = 0.3
    with pytest.raises(SolverError, match=r"boundaries\.1: .*\(methods\.1\.origin, methods\.1\.cell\)"):
        Simulation(MPI.COMM_SELF, parse_scene(data))


def test_bodies_of_a_grid_that_must_part_have_grids_of_their_own():
    data = tables(("metal",))
    (first,) = data["bodies"]
    data["bodies"] = [copy.deepcopy(first) | {"name": f"m{number}"} for number in range(4)]
    for number, body in enumerate(data["bodies"]):
        body["shape"]["box"] = {"lower": [2.0 * number, 0.0], "upper": [2.0 * number + 1.0, 1.0]}
    scene = parse_scene(data)
    assert [system.bodies for system in scene.systems] == [(0, 1, 2, 3)]
    data["contact"] = [{"bodies": pair, "model": "grid"} for pair in (["m0", "m1"], ["m1", "m2"])]
    split = parse_scene(data)
    assert [(system.name, system.bodies) for system in split.systems] == [("metal-1", (0, 2, 3)), ("metal-2", (1,))]
    sim = Simulation(MPI.COMM_SELF, split)
    assert [system.owned for system in sim.systems] == [192, 64]
    # those that are bonded share one
    bonded = parse_scene(data | {"bond": [{"bodies": ["m3", "m1"]}]})
    assert [system.bodies for system in bonded.systems] == [(0, 2), (1, 3)]
    # bodies of other methods need no systems of their own
    data["methods"] = [{"name": "metal", "kind": "ulsph"}]
    del data["contact"]
    assert len(parse_scene(data | {"contact": [{"bodies": ["m0", "m1"]}]}).systems) == 1


def test_a_term_that_methods_count_differently_has_two_columns():
    scene = mixed(("metal", "flow"))
    signs = terms_of(scene)
    assert (signs["heat_supplied"], signs["heat_supplied_ulsph"], signs["plastic_work"]) == (-1, 0, 0)
    assert names_of_terms(scene)[1]["heat_supplied"] == "heat_supplied_ulsph"
    assert EnergyLimits.of(system.settings for system in scene.systems).balance_warning == 0.03


def test_a_restart_may_change_of_each_method_what_it_may_of_one():
    data = tables(PAIR)
    before = contents(parse_scene(data))
    data["methods"][1] |= {"cfl": 0.2, "cell": 0.5}
    data["bodies"][0]["method"], data["bodies"][1]["method"] = "metal", "soft"
    found = list(changes(before, before | contents(parse_scene(tables(PAIR))), 1.0))
    assert not found
    data["bodies"][0]["method"], data["bodies"][1]["method"] = "soft", "metal"
    found = list(changes(before, contents(parse_scene(data)), 1.0))
    wrong, notes = faults_and_notes(found, (), Path("checkpoint.h5"), 1.0)
    assert len(wrong) == 1 and wrong[0].startswith("methods.1.cell: expected 0.25 as in the checkpoint")
    assert [one.code for one in notes] == ["restart-change"] and notes[0].text.startswith("methods.1.cfl: 0.3 ")
