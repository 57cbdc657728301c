"""A restart compares the whole scene, and the files that it names by what is in them."""

import meshio
import numpy as np
import pytest
from solids import punch, tables

from parsolid.scene import parse_scene
from parsolid.scene.base_model import SceneModel
from parsolid.scene.bodies import Body
from parsolid.scene.method_settings import MethodSettings
from parsolid.scene.methods import method_kinds, settings_class
from parsolid.scene.schema import Scene
from parsolid.simulation.scene_changes import changes, completed, contents, faults_and_notes

TIME = 0.3


def compared(before: dict, now: dict, allowed: tuple[str, ...] = (), folder=".") -> tuple[list[str], list[str]]:
    old, new = (contents(parse_scene(data, folder)) for data in (before, now))
    return faults_and_notes(list(changes(old, new, TIME)), allowed, "checkpoint.h5", TIME)


def test_the_same_scene_has_not_changed():
    assert compared(punch(), punch()) == ([], [])


def test_every_key_that_is_not_in_the_list_is_refused():
    """Each number, text and switch of a resolved scene, changed by itself."""
    scene = contents(parse_scene(punch(probes=[{"name": "p", "at": [1.0, 1.0], "fields": ["stress"]}])))
    seen = 0
    for place in _leaves(scene):
        key = ".".join(map(str, place))
        (change,) = changes(scene, _with(scene, place, "another"), TIME)
        assert change.key == key or key.startswith(change.key)
        faults, _ = faults_and_notes([change], (), "checkpoint.h5", TIME)
        assert bool(faults) == (change.rule not in ("free", "silent")), key
        if faults:
            assert faults[0].startswith(f"{change.key}: expected ") and "'another'" in faults[0]
            assert bool(faults_and_notes([change], (change.key,), "", TIME)[0]) == (change.rule == "fixed")
        seen += 1
    assert seen > 40


def test_a_key_more_or_less_is_a_change():
    more = punch(loads={"acceleration": ["0", "-9.81"]})
    added, removed = compared(punch(), more)[0], compared(more, punch())[0]
    assert added[0].startswith("loads.acceleration: expected nothing as in the checkpoint checkpoint.h5, found ['0', ")
    assert removed[0].startswith("loads.acceleration: expected ['0', '-9.81'] as in the checkpoint ")
    assert "found nothing" in removed[0] and len(added) == len(removed) == 1


PAIR = [
    {
        "name": name,
        "particles": [4, 4],
        "placement": "cells",
        "shape": {"box": {"lower": [0, low], "upper": [1, low + 1]}},
    }
    | {"material": {"kind": "linear-elastic", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}}
    for name, low in (("a", 0.0), ("b", 1.0))
]


def bonds(contact, **control):
    """Two peridynamic blocks, bonded or in contact, with keys of a control."""
    method = {"kind": "peridynamics", "stabilisation": control}
    return {"dimension": 2, "end_time": 1.0, "method": method, "bodies": PAIR, "contact": contact}


@pytest.mark.parametrize(
    "contact, control, found",
    [
        ([{"bodies": ["a", "b"]}], {}, "0.35 as in the checkpoint checkpoint.h5, found 0.125"),
        ([{"bodies": ["a", "b"]}], {"coefficient": 0.35}, None),
        ([], {}, None),
        ([], {"coefficient": 0.35}, None),
    ],
    ids=["contact", "stated", "bonded", "bonded, stated"],
)
def test_a_checkpoint_from_before_contact_had_a_control_of_its_own_names_the_key(contact, control, found):
    """Bodies in contact had that of all others, which nobody had to state."""
    now = contents(parse_scene(bonds(contact, **control)))
    before = now | {"method": now["method"] | {"stabilisation": dict(now["method"]["stabilisation"])}}
    before["method"]["stabilisation"].pop("coefficient", None)
    faults = faults_and_notes(list(changes(completed(before), completed(now), TIME)), (), "checkpoint.h5", TIME)[0]
    assert len(faults) == (found is not None)
    assert not faults or (faults[0].startswith("method.stabilisation.coefficient: expected") and found in faults[0])


@pytest.mark.parametrize("stated, faults", [("kernel", 0), (None, 0), ("best", 1)])
def test_a_checkpoint_from_before_boxes_had_weights_of_their_own_goes_on_where_the_kernel_is_stated(stated, faults):
    """Bodies had the kernel's weights, which nobody had to state."""
    method = {"weights": stated} if stated else {"integrator": "ssp-rk3"}
    now = contents(parse_scene(tables((4, 4), method={"kind": "tlsph", **method})))
    before = now | {"method": {key: value for key, value in now["method"].items() if key != "weights"}}
    told = faults_and_notes(list(changes(completed(before), completed(now), TIME)), (), "checkpoint.h5", TIME)[0]
    assert len(told) == faults
    assert not told or told[0].startswith("method.weights: expected 'kernel' as in the checkpoint")


def _leaves(value, place=()):
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in entries:
        yield from _leaves(part, (*place, key))
    if not isinstance(value, dict | list):
        yield place


def _with(value, place, leaf):
    if not place:
        return leaf
    if isinstance(value, dict):
        return value | {place[0]: _with(value[place[0]], place[1:], leaf)}
    return [_with(part, place[1:], leaf) if i == place[0] else part for i, part in enumerate(value)]


def test_rules_are_of_keys_that_tables_have():
    methods = [settings_class({"kind": kind}) for kind in method_kinds()]
    known = {MethodSettings: {key for one in methods for key in one.model_fields}}
    models = [*_models(SceneModel)]
    assert {Scene, Body, MethodSettings} <= {one for one in models if "on_restart" in vars(one)}
    for model in models:
        assert vars(model).get("on_restart", {}).keys() <= known.get(model, model.model_fields.keys()), model


def _models(model):
    yield model
    for one in model.__subclasses__():
        yield from _models(one)


def history(*rows) -> dict:
    return {"acceleration": ["0", "-9.81"], "history": {"rows": [list(row) for row in rows]}}


BEFORE = history((0.0, 0.0), (0.2, 1.0), (0.4, 1.0), (0.9, 0.0))


@pytest.mark.parametrize(
    "after, accepted",
    [
        # later than the checkpoint, from the factor that it had then
        (history((0.0, 0.0), (0.2, 1.0), (0.4, 1.0), (0.8, 3.0)), True),
        (history((0.0, 0.0), (0.2, 1.0)), True),
        # earlier, or another factor at the checkpoint
        (history((0.0, 0.0), (0.25, 1.0), (0.4, 1.0), (0.9, 0.0)), False),
        (history((0.0, 0.0), (0.2, 1.0), (0.4, 2.0)), False),
    ],
)
def test_a_load_may_change_after_the_checkpoint(after, accepted):
    faults, notes = compared(punch(loads=BEFORE), punch(loads=after))
    assert (not faults) == accepted == bool(notes)
    assert (faults or [one.text for one in notes])[0].startswith("loads.history.rows: ")


def test_jumps_may_change_after_the_checkpoint():
    loads = {"acceleration": ["0", "where(t < 0.5, 0, 1)"], "jumps": [0.1, 0.5]}
    assert not compared(punch(loads=loads), punch(loads=loads | {"jumps": [0.1, 0.6]}))[0]
    assert compared(punch(loads=loads), punch(loads=loads | {"jumps": [0.2, 0.5]}))[0]
    # one at the time of the checkpoint is of before
    assert compared(punch(loads=loads), punch(loads=loads | {"jumps": [0.1, TIME, 0.5]}))[0]


def test_files_are_compared_by_what_is_in_them(tmp_path):
    points = np.array([[x, y, 0.0] for x in range(3) for y in range(3)], float)
    cells = np.array([[0, 3, 4, 1], [1, 4, 5, 2], [3, 6, 7, 4], [4, 7, 8, 5]])
    for folder, stretch in (("a", 1.0), ("b", 1.0), ("c", 1.01)):
        (tmp_path / folder).mkdir()
        meshio.write(tmp_path / folder / "m.vtu", meshio.Mesh(points * [stretch, 1.0, 0.0], [("quad", cells)]))
        end = 0.9 if folder == "a" else 0.8
        (tmp_path / folder / "f.csv").write_text(f"t,f\n0,0\n0.2,1\n{end},1\n")
    data = tables((3, 3), loads=history() | {"history": {"file": "f.csv"}})
    body = data["bodies"][0]
    body["shape"] = {"mesh": {"file": "m.vtu"}}
    del body["particles"]
    scenes = {folder: contents(parse_scene(data, tmp_path / folder)) for folder in "abc"}
    assert [change.key for change in changes(scenes["a"], scenes["b"], TIME)] == ["loads.history.rows"]
    (change,) = changes(scenes["a"], scenes["b"], TIME)
    assert change.later
    assert [change.key for change in changes(scenes["b"], scenes["c"], TIME)] == ["bodies.0.shape.mesh.file"]
