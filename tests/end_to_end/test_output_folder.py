"""What a run does to the folder of its results, and what it says when it cannot write there."""

import os
import subprocess
from contextlib import contextmanager
from pathlib import Path

import pytest
from command_line import all_done, kill, many, start, wait_for, wait_until_free
from run_results import history, state
from small_scenes import PUNCH, changed, write

RANKS = 2


def test_a_new_run_into_a_folder_with_results_loses_none(tmp_path):
    scene, folder = write(PUNCH, tmp_path / "scene.toml"), tmp_path / "run"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    run = [scene, "-o", folder, "--max-steps", "2"]
    all_done(many([[*run, "-q"]], RANKS, tmp_path / "first"))
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    second = many([run], RANKS, tmp_path / "second")
    all_done(second)
    assert str(folder / "previous-1") in second[0][0].out + second[0][0].err
    aside = {path.name: path.read_bytes() for path in (folder / "previous-1").iterdir()}
    assert {"history.csv", "checkpoint.h5", "fields.vtkhdf", "scene.toml", "summary.json"} <= set(aside)
    assert before == aside | {"notes.txt": b"mine"} and (folder / "notes.txt").read_text() == "mine"


def test_a_second_run_into_the_folder_of_a_running_one_is_refused(tmp_path):
    endless = changed(PUNCH, {"end_time": 10.0, "output.checkpoint_steps": 20})
    scene, folder = write(endless, tmp_path / "scene.toml"), tmp_path / "run"
    first = start([scene, "-q", "-o", folder], RANKS)
    wait_for((folder / "history.csv").exists, first)
    try:
        for more in ([], ["--restart", folder / "checkpoint.h5"]):
            if more:
                wait_for((folder / "checkpoint.h5").exists, first)
            before = (folder / "history.csv").stat().st_ino
            second = many([[scene, "-q", "-o", folder, *more]], RANKS, tmp_path / f"second-{len(more)}")[0]
            assert [rank.status for rank in second] == [2] * RANKS and not second[1].err
            assert "found another run that writes there (host " in second[0].err and "Traceback" not in second[0].err
            assert first.poll() is None and (folder / "history.csv").stat().st_ino == before
            assert not list(folder.glob("previous-*"))
    finally:
        kill(first)
        first.communicate()
    wait_until_free(folder)
    # killed, it is not in the way, and goes on without a lost row
    all_done(many([[scene, "-q", "-o", folder, "--restart", "--max-steps", "2"]], RANKS, tmp_path / "third"))
    steps = history(folder)["step"]
    assert steps.tolist() == list(range(len(steps))) and not (folder / "run.lock").exists()


@contextmanager
def small_disk(path: Path, kilobytes: int):
    """A file system of so many kB; skips the test where none can be mounted."""
    path.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", path]
    if os.geteuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("mounting a small file system needs root")
    try:
        yield path
    finally:
        subprocess.run(["umount", path], check=True)


def test_a_full_disk_ends_the_run_with_a_message_and_keeps_what_there_is(tmp_path):
    often = {"output.checkpoint_steps": 2, "output.fields_interval": 1e-4, "end_time": 0.05}
    scene = write(changed(PUNCH, often | {"bodies.0.particles": [17, 17]}), tmp_path / "scene.toml")
    with small_disk(tmp_path / "disk", 1500) as disk:
        # in a job of its own: the disk goes away with it
        ranks = many([[scene, "-q", "-o", disk / "run"]], RANKS, tmp_path / "job", alone=True)[0]
        assert [rank.status for rank in ranks] == [1] * RANKS, ranks[0].err
        assert (ranks[0].err.startswith("parsolid: ") and "full" in ranks[0].err) or "No space left" in ranks[0].err
        assert not ranks[1].err and "Traceback" not in ranks[0].err
        header, fields, _ = state(disk / "run")
        assert header["step"] > 0 and len(fields["identifier"]) == 17 * 17
        assert history(disk / "run")["step"][-1] >= header["step"]
