"""`parsolid keys`, its --json and --new: every key is told, as it is; editors accept what the reader accepts."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from parsolid.collective import SolverError
from parsolid.commands.cli import main
from parsolid.commands.keys.description import keys_of
from parsolid.commands.keys.json_schema import scene_schema
from parsolid.commands.keys.listing import listing
from parsolid.commands.keys.starting import starting_scene
from parsolid.scene import parse_scene
from parsolid.scene.methods import method_kinds
from parsolid.scene.schema import Scene

ROOT = Path(__file__).parents[2]
# tables that have a friction
HELD = ("contact", "tools")


def tables_of(model=Scene, place=(), seen=None):
    """Every table of a scene with where it stands."""
    seen = {} if seen is None else seen
    if model not in seen:
        seen[model] = ".".join(place)
        for key in keys_of(model):
            for kind, table in key.value.tables.items():
                tables_of(table, (*place, key.name, *filter(None, [kind])), seen)
    return seen


def test_every_key_says_what_it_takes_and_what_it_means():
    keys = [(place, model, key) for model, place in tables_of().items() for key in keys_of(model)]
    assert len(keys) > 250
    unknown = [f"{place}.{key.name}" for place, _, key in keys if key.value.words == "any value"]
    assert not unknown
    silent = [f"{place}.{key.name} ({model.__module__})" for place, model, key in keys if not key.meaning]
    assert not silent, "\n".join(silent)


def test_a_listing_of_one_key_one_table_and_all_kinds():
    assert listing("bodies.jitter").startswith("bodies.jitter: a number >= 0 and < 0.5; default 0\n    random offset")
    assert listing("bodies.0.material.neo-hookean.density") == (
        "bodies.material.neo-hookean.density: a number > 0; needed\n    the density [kg/m^3]"
    )
    assert 'method.tlsph.integrator: "ssp-rk3" or "leapfrog"; default "leapfrog"' in listing("method.tlsph")
    kinds = listing("bodies.material")
    assert "kind: mooney-rivlin, neo-hookean" in kinds and "bodies.material.elastic-plastic.flow_stress" in kinds
    everything = listing()
    for words in ("end_time: a number > 0; needed", "method.mpm.cell: ", "output.fields_interval: ", "probes.name: "):
        assert words in everything


def test_what_a_key_means_is_told_to_its_end():
    """A line of a table in a docstring that begins neither a key nor further in would end the meaning before it."""
    broken = [
        f"{owner.__name__}: {line.strip()}"
        for model in tables_of()
        for owner in model.__mro__
        for before, line, after in zip(*((owner.__doc__ or "").splitlines()[k:] for k in range(3)))
        if re.match(r" {4}\S+( \S+)*$", line) and re.match(r" {10}|.*\S {2,}\S", before) and re.match(" {10}", after)
    ]
    assert not broken


def test_a_word_alone_is_looked_for_in_all_tables():
    assert listing("friction").splitlines()[::3] == [f"{table}.friction: a number >= 0; default 0" for table in HELD]
    assert listing("steinberg-cochran-guinan").startswith("[bodies.material.elastic-plastic.")
    assert "bodies.material.neo-hookean.zeta: 0; default 0" in listing("zeta")


@pytest.mark.parametrize(
    "path, said",
    [
        ("bodies.jiter", "expected one of .* after bodies, found 'jiter' .did you mean 'jitter'"),
        ("method.tlsp.cfl", "expected one of .*tlsph.* after method, found 'tlsp' .did you mean 'tlsph'"),
        ("end_time.more", "expected nothing after end_time, which is no table, found 'more'"),
    ],
)
def test_a_path_that_leads_nowhere(path, said, capsys):
    with pytest.raises(SolverError, match=said):
        listing(path)
    assert main(["keys", path]) == 2


def test_the_schema_accepts_the_scenes_that_the_reader_accepts_and_refuses_what_it_refuses(capsys):
    jsonschema = pytest.importorskip("jsonschema")
    assert main(["keys", "--json"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema == json.loads(json.dumps(scene_schema()))
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    paths = [*ROOT.glob("runs/**/*.toml"), *ROOT.glob("parsolid/**/*.toml")]
    scenes = {path: table for path in paths if "bodies" in (table := tomllib.loads(path.read_text()))}
    assert len(scenes) > 30
    faults = {str(path): str(error.message) for path, scene in scenes.items() for error in validator.iter_errors(scene)}
    assert not faults
    punch = scenes[ROOT / "runs" / "tlsph" / "punch.toml"]
    for wrong in (
        {"end_time": -1.0},
        {"end_tme": 1.0},
        {"method": {"kind": "tlsph", "smoothing": "wide"}},
        {"method": {"kind": "tlsph", "horizon_ratio": 3.0}},
        {"dimension": 4},
        {"bodies": []},
    ):
        assert not validator.is_valid(punch | wrong), wrong
    assert not validator.is_valid({key: value for key, value in punch.items() if key != "end_time"})


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
    for kind, said in (("roller", "A support on a plane"), ("wall", "A rigid plane that moves")):
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
