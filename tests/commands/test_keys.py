"""`parsolid keys`, its --json and --new: every key is told, as it is; editors accept what the reader accepts."""

import json
import tomllib
from pathlib import Path

import pytest
from small_scenes import changed

from parsolid.commands.cli import main
from parsolid.commands.keys import Table, listing, scene_schema, starting_scene
from parsolid.scene import parse_scene
from parsolid.scene.methods import method_kinds
from parsolid.scene.schema import Scene

ROOT = Path(__file__).parents[2]
# tables that have a friction
HELD = ("contact", "tools")


def keys_of(table, place=(), seen=None):
    """Every key of a table and of those within, with where it stands."""
    seen = set() if seen is None else seen
    if id(table.schema) not in seen:
        seen.add(id(table.schema))
        for key in table.keys.values():
            yield ".".join((*place, key.name)), key
            for kind, one in key.tables.items():
                yield from keys_of(one, (*place, key.name, *filter(None, [kind])), seen)


def test_every_key_says_what_it_takes_and_what_it_means():
    keys = dict(keys_of(Table.of(Scene)))
    assert len(keys) > 250
    assert not [place for place, key in keys.items() if key.words == "any value"]
    assert not [place for place, key in keys.items() if not key.meaning]


def test_a_listing_of_one_key_one_table_and_a_word_alone():
    assert listing("bodies.jitter").startswith("bodies.jitter: a number >= 0 and < 0.5; default 0\n")
    assert listing("bodies.0.material.neo-hookean.density").startswith("bodies.material.neo-hookean.density: ")
    assert 'method.tlsph.integrator: "ssp-rk3" or "leapfrog" or "static" or "implicit"; ' in listing("method.tlsph")
    assert "bodies.material.elastic-plastic.flow_stress" in listing("bodies.material")
    assert all(key in listing() for key in ("end_time: ", "method.mpm.cell: ", "output.fields_interval: "))
    # looked for in all tables
    assert listing("friction").splitlines()[::3] == [f"{table}.friction: a number >= 0; default 0" for table in HELD]
    assert listing("steinberg-cochran-guinan").startswith("[bodies.material.elastic-plastic.")
    assert "bodies.material.neo-hookean.zeta: 0; default 0" in listing("zeta")


@pytest.mark.parametrize(
    "path, word", [("bodies.jiter", "'jitter'"), ("method.tlsp.cfl", "'tlsph'"), ("end_time.more", "'more'")]
)
def test_a_path_that_leads_nowhere(path, word, capsys):
    assert main(["keys", path]) == 2 and word in capsys.readouterr().err


def shipped() -> dict[Path, dict]:
    """Tables of all scenes of the repository, by path."""
    paths = [*ROOT.glob("runs/**/*.toml"), *ROOT.glob("parsolid/**/*.toml"), *ROOT.glob("examples/*.toml")]
    return {path: table for path in paths if "bodies" in (table := tomllib.loads(path.read_text()))}


@pytest.fixture(scope="module")
def validator():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(scene_schema())
    return jsonschema.Draft202012Validator(scene_schema())


def test_the_schema_accepts_the_scenes_that_the_reader_accepts(validator, capsys):
    assert main(["keys", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(scene_schema(), allow_nan=False))
    plain = type(validator)(Scene.model_json_schema())
    scenes = shipped()
    assert len(scenes) > 60
    for one in (validator, plain):
        assert not {str(path): fault.message for path, scene in scenes.items() for fault in one.iter_errors(scene)}


PUNCH = tomllib.loads((ROOT / "runs" / "tlsph" / "punch.toml").read_text())


@pytest.mark.parametrize(
    "wrong",
    [
        *({key: None} for key in ("end_time", "dimension", "bodies")),
        {"end_tme": 1.0},
        {"dimension": 4},
        {"bodies": []},
        {"end_time": -1.0},
        {"end_time": [[True]]},
        {"method.kind": "tlsph-like"},
        {"method.smoothing": "wide"},
        {"method.horizon_ratio": 3.0},
        {"bodies.0.material.kind": "rubber"},
        {"bodies.0.material.youngs_modulos": 1.0},
        {"bodies.0.shape.box.lower": "low"},
        {"boundaries.0.where": "base"},
        {"boundaries.0": {"kind": "fixed"}},
        {"probes": [{"name": "a", "at": [0.0, 0.0], "weight": "X", "fields": ["velocity"]}]},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(validator, wrong):
    assert validator.is_valid(PUNCH) and not validator.is_valid(changed(PUNCH, wrong))


@pytest.mark.parametrize("method", method_kinds())
def test_a_scene_to_start_from_is_sound_and_says_what_each_key_is(method, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["keys", "--new", method]) == 0
    text = Path("scene.toml").read_text()
    assert text == starting_scene(method) and "parsolid run scene.toml" in capsys.readouterr().out
    scene = parse_scene(tomllib.loads(text))
    assert scene.method.kind == method and scene.probes and scene.title
    stated = [line for line in text.splitlines() if " = " in line and line[0] != "#"]
    assert sum("  # " in line for line in stated) >= len(stated) - 2
    for kind, said in (("roller", "A support on a plane"), ("wall", "A rigid plane with")):
        told = [line for line in stated if line.startswith(f'kind = "{kind}"')]
        assert all(line.partition("  # ")[2].startswith(said) for line in told)
    offered = {line[2:].partition(" = ")[0] for line in text.splitlines() if line.startswith("# ") and " = " in line}
    fields = set(type(scene.method).model_fields)
    assert offered <= fields and fields - offered == set(tomllib.loads(text)["method"])
    Path("scene.toml").write_text("mine")
    assert main(["keys", "--new", method]) == 2 and Path("scene.toml").read_text() == "mine"
    assert main(["keys", "--new", method, "-o", "other.toml"]) == 0 and Path("other.toml").read_text() == text


@pytest.mark.parametrize(
    "words", [["--new", "tlsp"], ["bodies", "--json"], ["--json", "--new", "mpm"], ["-o", "x.toml"]]
)
def test_what_is_not_there_and_words_that_exclude_each_other_are_refused(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["keys", *words]) == 2 and not list(tmp_path.iterdir())
