"""The first word of the command line: a command, a scene in its place, or neither."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from parsolid.commands.cli import COMMANDS, main, parse
from parsolid.launcher import environment
from parsolid.simulation import signals

RUNS = Path(__file__).parents[2] / "runs"
PUNCH = RUNS / "tlsph" / "punch.toml"


@pytest.mark.parametrize(
    "word, meant", [("runn", " (did you mean 'run'?)"), ("simulate", ""), ("./block", ""), ("", "")]
)
def test_a_word_that_is_no_command_and_no_scene(word, meant, capsys):
    assert main([word, "block.toml"]) == 2
    said = capsys.readouterr().err
    assert all(command in said for command in COMMANDS)
    assert said.rstrip().endswith(f"found {word!r}{meant}")


@pytest.mark.parametrize(
    "words",
    [
        ["-o", ""],
        ["--output="],
        ["--restart", ""],
        ["--set", "output.directory=''"],
        ["--log", "history.csv"],
        ["-q", "-v"],
        ["--dry-run", "-v"],
        ["--core-seconds", "9"],
    ],
)
def test_bad_options_leave_the_working_folder_alone(words, tmp_path, monkeypatch):
    (tmp_path / "history.csv").write_text("kept")
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(PUNCH), "--max-steps", "1", *words]) == 2
    # nor is a scene without a name the main example
    assert main(["run", ""]) == main(["check", ""]) == 2
    assert [one.read_text() for one in tmp_path.iterdir()] == ["kept"]


def test_a_quiet_dry_run_says_nothing(capsys):
    assert main(["run", str(PUNCH), "--dry-run", "-q"]) == 0
    assert capsys.readouterr().out == ""


def test_a_scene_may_stand_in_the_command_s_place(tmp_path):
    (tmp_path / "block").write_text("")
    for words in (["block.toml", "-q"], [str(tmp_path / "block")], ["-q"]):
        assert parse(words).command == "run"
    assert parse(["check", "block"]).scene == "block"


def test_no_word_at_all_tells_what_there_is_and_how_to_run_the_example(capsys):
    assert main([]) == 0
    told = capsys.readouterr().out
    assert all(f"    {command} " in told for command in COMMANDS) and "parsolid run" in told


@pytest.mark.serial
@pytest.mark.slow
def test_ranks_are_started_and_their_status_is_that_of_the_command(tmp_path):
    sets = ["--set", "bodies.0.particles=[5, 5]", "--set", "end_time=1e-4", "--set", "output.pictures=false"]
    words = ["run", str(PUNCH), "--ranks", "2", "-q", "-o", str(tmp_path / "two"), *sets]
    program = [sys.executable, "-m", "parsolid"]
    assert subprocess.run([*program, *words], env=environment()).returncode == 0
    assert json.loads((tmp_path / "two" / "summary.json").read_text())["ranks"] == 2
    refused = subprocess.run([*program, *words, "--set", "end_time=-1"], env=environment(), capture_output=True)
    assert refused.returncode == 2


@pytest.mark.parametrize("command", COMMANDS)
def test_signals_are_caught_early_for_commands_alone_that_stop_with_a_checkpoint(command, monkeypatch):
    caught = []
    monkeypatch.setattr(signals.REQUEST, "install", lambda: caught.append(command))
    signals.catch_early([command])
    assert bool(caught) == (command in ("run", "pareto"))


def test_an_import_of_no_file_tells_of_the_mesh(tmp_path, capsys):
    """And ends what a signal has asked of the process, which a run after it would obey."""
    signals.REQUEST.received = "SIGTERM"
    assert main(["import", str(tmp_path / "none.msh"), str(tmp_path / "new.h5")]) == 2
    assert capsys.readouterr().err.removeprefix("parsolid: ").startswith("mesh:") and not [*tmp_path.iterdir()]
    assert signals.REQUEST.received is None


@pytest.mark.serial
@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs a file system that takes no folder")
@pytest.mark.parametrize("command", ["study", "verify", "point", "run --error-bars", "run --target=kinetic=10%"])
def test_folders_that_cannot_be_written_are_bad_input(command, capsys):
    name, *more = command.split()
    folder = RUNS / "tlsph" / "studies" if name in ("study", "verify") else RUNS / "point"
    file = PUNCH if name == "run" else sorted(folder.glob("*.toml"))[0]
    assert main([name, str(file), "-o", "/proc/x", *more]) == 2
    said = capsys.readouterr().err
    assert "/proc/x" in said and said.count("\n") == 1


@pytest.mark.serial
@pytest.mark.parametrize("more", ["--error-bars", "--max-steps=3"])
def test_options_that_a_target_leaves_without_effect_are_refused(more, tmp_path):
    assert main(["run", str(PUNCH), "-o", str(tmp_path / "run"), "--target=kinetic=10%", more]) == 2
    assert main(["check", str(PUNCH), "-o", str(tmp_path / "run")]) == 2 and not [*tmp_path.iterdir()]


@pytest.mark.serial
@pytest.mark.slow
def test_ranks_that_are_told_to_stop_leave_a_checkpoint(tmp_path):
    folder = tmp_path / "two"
    words = ["run", str(PUNCH), "--ranks=2", "-q", "-o", str(folder), "--set", "end_time=10.0"]
    job = subprocess.Popen([sys.executable, "-m", "parsolid", *words], env=environment())
    try:
        while not (folder / "history.csv").exists():
            assert job.poll() is None
            time.sleep(0.05)
        job.send_signal(signal.SIGTERM)
        assert job.wait(60) == 75 and (folder / "checkpoint.h5").exists()
    finally:
        job.kill()
