"""Words of earlier versions are refused with the present ones, wherever a user may still write them."""

import pytest
import tomli_w
from solids import tables

from parsolid.campaign.cases import load_study
from parsolid.campaign.targets import Target, columns_of
from parsolid.commands.cli import main
from parsolid.output.results import Results
from parsolid.scene import SceneError, parse_scene
from parsolid.scene.validation_errors import RENAMED

pytestmark = pytest.mark.serial
BOX = {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}}


def scene(place: tuple = ("title",), value: object = "renamed", **changes) -> dict:
    """Raw tables with a value at a place, and other tables."""
    table = data = tables([5, 5], end_time=0.01) | changes
    for key in place[:-1]:
        table = table[key] if isinstance(table, list) else table.setdefault(key, {})
    table[place[-1]] = value
    return data


# old word -> a scene that has it, and where
IN_SCENES = {
    "heated": (scene(("bodies", 0, "heated"), "stress-free"), "bodies.0.heated"),
    "pair_correction": (scene(("method", "pair_correction"), "closure"), "method.pair_correction"),
    "cost": (scene(("run", "cost"), 1.0), "run.cost"),
    "micro_clamped": (scene(boundaries=[{"kind": "micro_clamped"} | BOX]), "boundaries.0.kind"),
    "heat_flux": (scene(boundaries=[{"kind": "heat_flux", "plane": "X = 0"}]), "boundaries.0.kind"),
    "surface_pressure": (scene(boundaries=[{"kind": "surface_pressure", "plane": "X = 0"}]), "boundaries.0.kind"),
    "nodes": (scene(("bodies", 0, "placement"), "nodes"), "bodies.0.placement"),
}
ELSEWHERE = ("yardstick", "internal_dissipation")
COLUMNS = [word for word in RENAMED if word not in (*IN_SCENES, *ELSEWHERE)]


@pytest.mark.parametrize("word", IN_SCENES)
def test_an_old_key_or_kind_is_refused_with_the_new_one(word, tmp_path, capfd):
    data, key = IN_SCENES[word]
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(data))
    assert main(["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "results")]) == 2
    (line,) = (one for one in capfd.readouterr().err.splitlines() if f"{key}:" in one)
    assert repr(RENAMED[word][0]) in line and not (tmp_path / "results").exists()


@pytest.mark.parametrize("word", COLUMNS)
def test_an_old_column_is_refused_with_the_new_one(word, tmp_path):
    known = [*columns_of(parse_scene(scene())), *RENAMED[word], "energy_error"]
    with pytest.raises(SceneError) as caught:
        Target.parse(f"{word}=2%", known)
    assert all(repr(name) in str(caught.value) for name in RENAMED[word])
    for name, columns in (("new", RENAMED[word]), ("old", [word])):
        (tmp_path / name).mkdir()
        (tmp_path / name / "scene.toml").write_text("dimension = 2")
        rows = [",".join(["step", "time", *columns]), ",".join("0" for _ in range(2 + len(columns)))]
        (tmp_path / name / "history.csv").write_text("\n".join(rows) + "\n")
    with pytest.raises(SceneError) as caught:
        Results(tmp_path / "new").columns[word]
    assert repr(RENAMED[word][0]) in str(caught.value)
    with pytest.raises(SceneError, match=word):
        len(Results(tmp_path / "old").columns)


def test_old_columns_in_a_scene_and_keys_of_a_study(tmp_path):
    final = {"stored": 1.0, "balance": 1.0, "work_external": 1.0, "dissipation_internal": 1.0}
    with pytest.raises(SceneError) as caught:
        parse_scene(scene(reference={"final": final}))
    for word in final:
        (fault,) = (one for one in caught.value.faults if one.key == f"reference.final.{word}")
        assert repr(RENAMED[word][0]) in fault
    (tmp_path / "study.toml").write_text(
        'title = "t"\n[[series]]\nname = "a"\nscene = "b.toml"\nyardstick = { a = 1.0 }\n'
    )
    with pytest.raises(SceneError) as caught:
        load_study(tmp_path / "study.toml")
    assert any(RENAMED["yardstick"][0] in one for one in caught.value.faults)
