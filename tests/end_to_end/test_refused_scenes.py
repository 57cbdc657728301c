"""Bad input on two ranks: exit status 2, one message that names the key, no traceback, nothing created or
overwritten.
"""

import pytest
from command_line import many, parsolid
from small_scenes import PUNCH, changed, write

RANKS = 2
MATERIAL = "bodies.0.material"
PROBE = {"name": "p", "at": [0.0, 0.0], "fields": ["velocity"]}

# what is wrong: changes of the scene, and words of the message, the key first
BROKEN = {
    "unknown key": ({"method.smoothin": 1.0}, ("method.smoothin", "expected one of", "did you mean 'smoothing'")),
    "unknown table": ({"probs": [PROBE]}, ("probs", "did you mean 'probes'")),
    "wrong type": ({"end_time": "long"}, ("end_time", "expected a number", "found 'long'")),
    "missing key": ({"end_time": None}, ("end_time", "expected", "found nothing")),
    "dimension": ({"dimension": 1}, ("dimension", "expected 2 or 3", "found 1")),
    "negative density": ({f"{MATERIAL}.density": -5.0}, (f"{MATERIAL}.density", "expected a number > 0", "found -5.0")),
    "incompressible": (
        {f"{MATERIAL}.poissons_ratio": 0.5},
        (f"{MATERIAL}.poissons_ratio", "expected a number < 0.5", "found 0.5"),
    ),
    "no such material": (
        {f"{MATERIAL}.kind": "mooney"},
        (f"{MATERIAL}.kind", "did you mean 'mooney-rivlin'", "found 'mooney'"),
    ),
    "negative relaxation time": (
        {f"{MATERIAL}.branches": [{"beta": 1.0, "tau": -1.0}]},
        (f"{MATERIAL}.branches.0.tau", "expected a number > 0", "found -1.0"),
    ),
    "no body": ({"bodies": []}, ("bodies", "expected a list of at least 1", "found")),
    "empty body": (
        {"bodies.0.particles": [1, 1]},
        ("bodies.0", "expected a body of at least two particles", "found 1"),
    ),
    "body turned over": (
        {"bodies.0.shape.box.upper": [1.0, -1.0]},
        ("bodies.0.shape.box.upper.1", "expected more than lower = 0", "found -1.0"),
    ),
    "overlapping keys": (
        {"bodies.0.spacing": 0.1},
        ("bodies.0", "at most one of particles, spacing", "found particles and spacing"),
    ),
    "missing mesh": (
        {"bodies.0.shape": {"mesh": {"file": "nowhere.msh"}}, "bodies.0.particles": None},
        ("bodies.0.shape.mesh.file", "expected an existing file", "nowhere.msh"),
    ),
    "unreadable formula": (
        {"bodies.0.velocity": ["0", "Y*("]},
        ("bodies.0.velocity.1", "expected a formula in X, Y", "found"),
    ),
    "unknown name in a formula": ({"bodies.0.velocity": ["0", "Z"]}, ("bodies.0.velocity.1", "unknown name 'Z'")),
    "formula that is no number": (
        {"bodies.0.velocity": ["0", "log(X - 0.5)"]},
        ("bodies.0.velocity.1", "expected a finite value of a size up to 1e+60 at every", "found nan at particle"),
    ),
    "traction that is no number": (
        {"boundaries.2": {"kind": "traction", "plane": "Y = 1", "traction": ["1/(X-1)", "0"]}},
        ("boundaries.2.traction.0", "expected a finite value", "found inf"),
    ),
    "plane through the body": (
        {"boundaries.0.plane": "X = 0.3"},
        ("boundaries.0.plane", "expected a plane that bounds a body", "found 'X = 0.3'"),
    ),
    "region without particles": (
        {
            "boundaries.0": {
                "kind": "velocity",
                "box": {"lower": [5.0, 5.0], "upper": [6.0, 6.0]},
                "velocity": ["0", "0"],
            }
        },
        ("boundaries.0", "expected a region that holds particles", "found 0"),
    ),
    "probe outside": (
        {"probes.0.at": [9.0, 9.0]},
        ("probes.0.at", "expected a point within one spacing", "found [9.0, 9.0]"),
    ),
    "twice the same probe": ({"probes": [PROBE, PROBE]}, ("probes.1.name", "expected a name other than", "found 'p'")),
    "unknown field": (
        {"output.fields": ["velocity", "presure"]},
        ("output.fields.1", "did you mean 'pressure'", "found 'presure'"),
    ),
    "field times out of order": (
        {"output.fields_interval": None, "output.fields_times": [2.0, 1.0]},
        ("output.fields_times.1", "expected a time later than the one before", "found 1.0"),
    ),
    "too little smoothing": (
        {"method.smoothing": 0.2},
        ("method.smoothing", "expected every particle to have a neighbour", "found none"),
    ),
    "update of a fixed reference": (
        {"method.update_every": 5},
        ("method.update_every", "expected no such key with the reference 'fixed'", "found 5"),
    ),
    "missing reference": (
        {"reference": {"series": "nowhere.json", "columns": {"kinetic": "K"}}},
        ("reference.series", "expected an existing file", "nowhere.json"),
    ),
}

# bad command lines: words after the scene, and words of the message
COMMANDS = {
    "unknown option": (["--restrat"], ("unrecognized arguments: --restrat",)),
    "override of nothing": (
        ["--set", "bodies.7.particles=[2,2]"],
        ("--set bodies.7.particles", "expected an index from 0 to 0"),
    ),
    "override that is none": (["--set", "end_time"], ("--set end_time", "expected key.path=value")),
    "negative end time": (["--end-time", "-1"], ("--end-time", "expected a positive number", "found -1")),
    "no steps": (["--max-steps", "0"], ("--max-steps", "expected a whole number of at least 1", "found 0")),
    "restart from nothing": (["--restart", "nowhere.h5"], ("nowhere.h5: does not exist",)),
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """(results of all ranks, folder of the output) of every fault; each folder holds something to lose."""
    folder = tmp_path_factory.mktemp("refused")
    names, commands = [*BROKEN, *COMMANDS], []
    for number, name in enumerate(names):
        output = folder / f"output-{number}"
        output.mkdir()
        (output / "history.csv").write_text("kept")
        scene = write(changed(PUNCH, BROKEN[name][0] if name in BROKEN else {}), folder / f"{number}.toml")
        commands.append([scene, "-o", output, *COMMANDS.get(name, ([],))[0]])
    ended = many(commands, RANKS, folder / "job")
    return {name: (ended[number], folder / f"output-{number}") for number, name in enumerate(names)}


@pytest.mark.parametrize("name", [*BROKEN, *COMMANDS])
def test_bad_input_is_refused_in_one_message(results, name):
    ranks, output = results[name]
    _, words = BROKEN.get(name) or COMMANDS[name]
    assert [rank.status for rank in ranks] == [2] * RANKS, ranks[0].err
    message = ranks[0].err
    assert all(word in message for word in words), message
    assert message.startswith("parsolid: ") and message.count("parsolid: ") == 1
    assert len(message.partition("usage:")[0].splitlines()) == 1, message
    # with no kernel in the cache the first rank says that it compiles
    said = [line for line in ranks[0].out.splitlines() if not line.startswith("compiling kernel")]
    assert not said and not any(rank.out or rank.err for rank in ranks[1:]), ranks
    assert [path.name for path in output.iterdir()] == ["history.csv"] and (
        output / "history.csv"
    ).read_text() == "kept"


def test_a_broken_scene_ends_the_job_with_status_2(tmp_path):
    scene = write(changed(PUNCH, {"end_time": -1.0, "method.cfl": "fast"}), tmp_path / "scene.toml")
    result = parsolid(scene, "-o", tmp_path / "results", ranks=RANKS, expect=2)
    assert "Traceback" not in result.err and not (tmp_path / "results").exists()
    told = [line.strip() for line in result.err.splitlines()]
    at = told.index("parsolid: the scene has 2 faults:")
    assert told[at + 1].startswith("end_time: expected a number > 0, found -1.0")
    assert told[at + 2].startswith("method.cfl: expected a number, found 'fast'")
    assert result.err.count("end_time:") == 1


# what differs from the scene of the checkpoint, and the message
OTHERS = {
    "bodies.0.particles=[7, 7]": "bodies.0.particles: expected [9, 9] as in the checkpoint CHECKPOINT, found [7, 7]",
    f"{MATERIAL}.density=1200.0": f"{MATERIAL}.density: expected 1100.0 as in the checkpoint CHECKPOINT, "
    f"found 1200.0 (where that is meant: --allow-change {MATERIAL}.density)",
    f"{MATERIAL}.branches=[{{ beta = 1.0, tau = 1.0 }}]": f"{MATERIAL}.branches: expected [] as in the checkpoint "
    f"CHECKPOINT, found [{{ beta = 1.0, tau = 1.0 }}] (where that is meant: --allow-change {MATERIAL}.branches)",
    "boundaries.1.kind=fixed": "boundaries.1.kind: expected 'roller' as in the checkpoint CHECKPOINT, found 'fixed' "
    "(where that is meant: --allow-change boundaries.1.kind)",
    "loads.acceleration=['0', '-9.81']": "loads.acceleration: expected nothing as in the checkpoint CHECKPOINT, "
    "found ['0', '-9.81'] (where that is meant: --allow-change loads.acceleration)",
    "method.smoothing=0.9": "method.smoothing: expected 0.85 as in the checkpoint CHECKPOINT, found 0.9 "
    "(where that is meant: --allow-change method.smoothing)",
    "bodies.0.velocity=['0', '0']": "bodies.0.velocity: expected ['0', '-100*Y*where(X < 0.5, 2*X, 1)'] as in the "
    "checkpoint CHECKPOINT, found ['0', '0']",
}


def test_a_checkpoint_of_another_scene_is_refused(tmp_path):
    scene = write(PUNCH, tmp_path / "scene.toml")
    run = [scene, "-q", "-o", tmp_path / "results"]
    again = [*run, "--restart"]
    commands = [[*run, "--max-steps", "2"], *([*again, "--set", change] for change in OTHERS)]
    commands += [[*again, "--allow-change", "method.smoothing"], [*run, "--allow-change", "method.smoothing"]]
    # the state of another material has no place in this one, whatever is allowed
    branches = [*again, "--set", list(OTHERS)[2], "--allow-change", "bodies.0.material"]
    done, *refused, unchanged, no_restart, other_state = many([*commands, branches], RANKS, tmp_path / "job")
    assert done[0].status == 0
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "results").iterdir()}
    checkpoint = str(tmp_path / "results" / "checkpoint.h5")
    for found, message in zip(refused, OTHERS.values()):
        assert [rank.status for rank in found] == [2] * RANKS and not found[1].err
        assert found[0].err == f"parsolid: {message.replace('CHECKPOINT', checkpoint)}\n"
    assert {path.name: path.stat().st_mtime_ns for path in (tmp_path / "results").iterdir()} == before
    assert [rank.status for rank in unchanged + no_restart + other_state] == [2] * 3 * RANKS
    assert "--allow-change method.smoothing: expected a key that has changed since" in unchanged[0].err
    assert "--allow-change method.smoothing: expected --restart with it, found none" in no_restart[0].err
    assert other_state[0].err.startswith("parsolid: bodies.material: expected the state of the checkpoint ")
    assert "found one with" in other_state[0].err and "viscous_strain_inverse_1" in other_state[0].err


def test_a_change_that_is_allowed_is_told_and_goes_into_the_next_checkpoint(tmp_path):
    scene = write(PUNCH, tmp_path / "scene.toml")
    run = [scene, "-o", tmp_path / "results", "--max-steps", "2"]
    denser = ["--restart", "--set", f"{MATERIAL}.density=1200.0", "--set", "method.cfl=0.5"]
    allowed = [*run, *denser, "--allow-change", f"{MATERIAL}.density"]
    commands = [[*run, "-q"], allowed, [*run, *denser], [*run, "--restart"]]
    first, changed_run, unchanged, refused = many(commands, RANKS, tmp_path / "job")
    assert [first[0].status, changed_run[0].status, unchanged[0].status, refused[0].status] == [0, 0, 0, 2]
    assert f"note: {MATERIAL}.density: 1100.0 " in changed_run[0].out and "note: method.cfl: 0.7 " in changed_run[0].out
    assert changed_run[0].out.count("[restart-change]") == 2
    assert "note:" not in unchanged[0].out
    assert f"{MATERIAL}.density: expected 1200.0 as in the checkpoint" in refused[0].err
