"""Asked to stop by a signal or by the clock, a run writes a checkpoint, ends with status 75 and goes on later."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import all_done, finish, many, ranks_of, start, wait_for
from run_results import assert_same_bits, state, summary
from small_scenes import PUNCH, changed, write

RANKS = 2
TO_BE_CONTINUED = 75


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """(scene, folder of the uninterrupted run); it takes long enough to be interrupted."""
    folder = tmp_path_factory.mktemp("stopped")
    slow = {"end_time": 0.01, "bodies.0.particles": [17, 17], "output.fields_interval": 1e-3}
    scene = write(changed(PUNCH, slow), folder / "scene.toml")
    all_done(many([[scene, "-q", "-o", folder / "whole"]], RANKS, folder / "job"))
    return scene, folder / "whole"


def stopped(scene, folder, number: int, receiver) -> None:
    """Start a run of a program and send a signal to the process receiver(job) once it computes."""
    job = start([scene, "-q", "-o", folder], RANKS)
    history = folder / "history.csv"
    wait_for(lambda: history.exists() and len(history.read_text().splitlines()) > 5, job)
    os.kill(receiver(job), number)
    result = finish(job)
    assert result.status == TO_BE_CONTINUED, f"{result.status}\n{result.err}"
    assert "Traceback" not in result.err


def test_a_signal_to_one_rank_or_to_mpirun_stops_all_and_a_restart_goes_on(whole, tmp_path):
    scene, expected = whole
    # Open MPI's mpirun passes on SIGUSR1 but not SIGTERM
    signals = {"SIGTERM": lambda job: sorted(ranks_of(job))[-1], "SIGUSR1": lambda job: job.pid}
    signals["SIGINT"] = lambda job: sorted(ranks_of(job))[0]
    for name, receiver in signals.items():
        folder = tmp_path / name
        stopped(scene, folder, getattr(signal, name), receiver)
        assert summary(folder)["status"] == "interrupted"
        assert state(folder)[0]["step"] == summary(folder)["steps"] < state(expected)[0]["step"]
    all_done(many([[scene, "-q", "-o", tmp_path / name, "--restart"] for name in signals], RANKS, tmp_path / "job"))
    for name in signals:
        assert_same_bits(tmp_path / name, expected)


def test_ranks_of_an_mpirun_that_is_killed_alone_end_too(whole, tmp_path):
    scene, _ = whole
    job = start([scene, "-q", "-o", tmp_path / "run"], RANKS)
    history = tmp_path / "run" / "history.csv"
    wait_for(lambda: history.exists() and len(history.read_text().splitlines()) > 5, job)
    left = ranks_of(job)
    assert len(left) == RANKS
    job.kill()
    job.wait()
    end = time.monotonic() + 20.0
    while any(map(runs, left)) and time.monotonic() < end:
        time.sleep(0.01)
    assert not any(map(runs, left))
    # a lock of theirs is in nobody's way; before the first checkpoint it is told that there is none
    ended = many([[scene, "-q", "-o", tmp_path / "run", "--restart"]], RANKS, tmp_path / "job")[0]
    assert [rank.status for rank in ended] == [2] * RANKS
    assert "no checkpoint was written yet in " in ended[0].err and len(ended[0].err.splitlines()) == 1


def runs(process: int) -> bool:
    """Whether a process is there and not only waited for; its other threads may end after the first one."""
    for thread in Path(f"/proc/{process}/task").glob("*/stat"):
        try:
            if thread.read_text().rpartition(")")[2].split()[0] != "Z":
                return True
        except OSError:
            pass
    return False


def test_ctrl_c_for_a_second_time_ends_at_once(whole, tmp_path):
    scene, expected = whole
    # steps of a stopped run are not waited for: the first signal comes while it sets up
    job = start([scene, "-q", "-o", tmp_path], RANKS)
    process = wait_for(lambda: next(iter(ranks_of(job)), None), job)
    # Python itself catches SIGINT, the run all of them
    wait_for(lambda: caught(process, signal.SIGTERM), job)
    os.kill(process, signal.SIGINT)
    wait_for(lambda: not caught(process, signal.SIGINT), job)
    os.kill(process, signal.SIGINT)
    result = finish(job, 20.0)
    assert result.status not in (0, TO_BE_CONTINUED) and "Traceback" not in result.err
    all_done(many([[scene, "-q", "-o", tmp_path / "after"]], RANKS, tmp_path / "job"))
    assert_same_bits(tmp_path / "after", expected)


def caught(process: int, number: int) -> bool:
    """Whether a process has a handler of its own for a signal."""
    status = Path(f"/proc/{process}/status").read_text()
    mask = int(status.split("\nSigCgt:")[1].split()[0], 16)
    return bool(mask >> (number - 1) & 1)


def test_the_wall_time_stops_a_run_again_and_again(whole, tmp_path):
    scene, expected = whole
    folder = tmp_path / "run"
    # the limit counts from the command's start, so it is over before the first step; one step is taken all the same
    run = [scene, "-q", "-o", folder, "--wall-time", "1e-3"]
    results = many([run, [*run, "--restart"], [*run[:-1], "1e6", "--restart"]], RANKS, tmp_path / "job")
    assert [[rank.status for rank in ranks] for ranks in results] == [[TO_BE_CONTINUED] * RANKS] * 2 + [[0] * RANKS]
    assert_same_bits(folder, expected)
    assert summary(folder)["steps"] == state(expected)[0]["step"]


def test_a_signal_after_the_end_leaves_the_status_as_it_is():
    words = "import os, signal; from parsolid.simulation.signals import hold; hold(); os.kill(os.getpid(), signal.{}); "
    for name in ("SIGINT", "SIGTERM", "SIGUSR1"):
        ended = subprocess.run([sys.executable, "-c", words.format(name) + "raise SystemExit(75)"], check=False)
        assert ended.returncode == 75
