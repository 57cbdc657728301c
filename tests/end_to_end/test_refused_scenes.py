"""Bad input on two ranks: exit status 2, one message that names the key, no traceback, nothing created or
overwritten.
"""

import pytest
from command_line import many, parsolid
from run_results import states
from small_scenes import PUNCH, changed, write

RANKS = 2
MATERIAL = "bodies.0.material"

# what is wrong: changes of the scene, words after it, and the key that is told
FAULTY = {
    "unknown key": ({"method.smoothin": 1.0}, [], "method.smoothin: "),
    "found at particles": ({"bodies.0.velocity": ["0", "log(X - 0.5)"]}, [], "bodies.0.velocity.1: "),
    "found between particles": ({"method.smoothing": 0.2}, [], "method.smoothing: "),
    "missing file": ({"reference": {"series": "no.json", "columns": {"kinetic": "K"}}}, [], "reference.series: "),
    "unknown option": ({}, ["--restrat"], "--restrat"),
    "override of nothing": ({}, ["--set", "bodies.7.particles=[2,2]"], "--set bodies.7.particles: "),
    "no steps": ({}, ["--max-steps", "0"], "--max-steps"),
    "restart from nothing": ({}, ["--restart", "nowhere.h5"], "nowhere.h5: "),
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """(results of all ranks, folder of the output) of every fault; each folder holds something to lose."""
    folder = tmp_path_factory.mktemp("refused")
    commands = []
    for number, (changes, words, _) in enumerate(FAULTY.values()):
        output = folder / f"output-{number}"
        output.mkdir()
        (output / "history.csv").write_text("kept")
        commands.append([write(changed(PUNCH, changes), folder / f"{number}.toml"), "-o", output, *words])
    ended = many(commands, RANKS, folder / "job")
    return {name: (ended[number], folder / f"output-{number}") for number, name in enumerate(FAULTY)}


@pytest.mark.parametrize("name", FAULTY)
def test_bad_input_is_refused_in_one_message(results, name):
    ranks, output = results[name]
    assert [rank.status for rank in ranks] == [2] * RANKS, ranks[0].err
    message = ranks[0].err
    assert FAULTY[name][2] in message
    assert message.startswith("parsolid: ") and message.count("parsolid: ") == 1
    assert len(message.partition("usage:")[0].splitlines()) == 1, message
    # with no kernel in the cache the first rank says that it compiles
    said = [line for line in ranks[0].out.splitlines() if not line.startswith("compiling kernel")]
    assert not said and not any(rank.out or rank.err for rank in ranks[1:]), ranks
    assert [path.name for path in output.iterdir()] == ["history.csv"]
    assert (output / "history.csv").read_text() == "kept"


def test_a_broken_scene_ends_the_job_with_status_2(tmp_path):
    scene = write(changed(PUNCH, {"end_time": -1.0, "method.cfl": "fast"}), tmp_path / "scene.toml")
    result = parsolid(scene, "-o", tmp_path / "results", ranks=RANKS, expect=2)
    assert "Traceback" not in result.err and not (tmp_path / "results").exists()
    assert result.err.count("end_time:") == result.err.count("method.cfl:") == 1


# what differs from the scene of the checkpoint, and its key
OTHERS = {
    "bodies.0.particles=[7, 7]": "bodies.0.particles",
    f"{MATERIAL}.branches=[{{ beta = 1.0, tau = 1.0 }}]": f"{MATERIAL}.branches",
    "loads.acceleration=['0', '-9.81']": "loads.acceleration",
}


def test_a_checkpoint_of_another_scene_is_refused(tmp_path):
    scene = write(PUNCH, tmp_path / "scene.toml")
    run = [scene, "-q", "-o", tmp_path / "results"]
    again = [*run, "--restart"]
    commands = [[*run, "--max-steps", "2"], *([*again, "--set", change] for change in OTHERS)]
    commands += [[*again, "--allow-change", "method.smoothing"], [*run, "--allow-change", "method.smoothing"]]
    # the state of another material has no place in this one, whatever is allowed
    commands += [[*again, "--set", list(OTHERS)[1], "--allow-change", "bodies.0.material"]]
    done, *refused = many(commands, RANKS, tmp_path / "job")
    assert done[0].status == 0
    keys = [*OTHERS.values(), "--allow-change method.smoothing", "--allow-change method.smoothing", "bodies.material"]
    for found, key in zip(refused, keys, strict=True):
        assert [rank.status for rank in found] == [2] * RANKS and not found[1].err
        assert found[0].err.startswith(f"parsolid: {key}: ") and found[0].err.count("\n") == 1
    header, *_ = states(tmp_path / "results")
    assert header["step"] == 2


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
