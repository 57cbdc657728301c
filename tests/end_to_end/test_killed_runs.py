"""Killed with SIGKILL at random instants while it writes a checkpoint every other step, or within an iteration of
Newton's method, a run always goes on from its last checkpoint.
"""

import random
import time

import pytest
from cases import between_dies
from command_line import all_done, finish, kill, many, start, wait_for, wait_until_free
from run_results import assert_same_bits, state
from small_scenes import COLUMN, changed, write
from tlsph.test_load_history import METAL

RANKS = 2
MANY = 30
# parsolid, whose last rank is killed before it takes one of its corrections by Newton's method
KILLED = """
import importlib, os, signal, sys
from mpi4py import MPI
from parsolid.commands.cli import main
newton = importlib.import_module("parsolid.solvers.newton")
left, shortened = [{corrections}], newton._shortened
def or_killed(*given):
    left[0] -= 1
    if left[0] < 0 and MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return shortened(*given)
newton._shortened = or_killed
sys.exit(main())
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """(scene, folder of an uninterrupted run, seconds that it took from its first step to its end)."""
    folder = tmp_path_factory.mktemp("killed")
    small = {
        "bodies.0.particles": [4, 7, 4],
        "end_time": 0.05,
        "output.checkpoint_steps": 2,
        "output.fields_interval": 0.005,
    }
    scene = write(changed(COLUMN, small), folder / "scene.toml")
    output = folder / "whole"
    job = start([scene, "-q", "-o", output], RANKS)
    wait_for(lambda: history_file(output), job)
    began = time.monotonic()
    assert finish(job).status == 0
    return scene, output, time.monotonic() - began


def history_file(output) -> int | None:
    """Number of the file that is history.csv now: each start and restart of a run makes a new one."""
    path = output / "history.csv"
    return path.stat().st_ino if path.exists() else None


def seconds_until_killed(job, output, lifetime: float, starting: bool) -> float | None:
    """Kill a job so many seconds after its launch (starting) or after its first step.

    None if it was killed, else the seconds after which it ended.
    """
    before = history_file(output)
    while not starting and history_file(output) == before and job.poll() is None:
        time.sleep(0.002)
    began = time.monotonic()
    while time.monotonic() < began + lifetime and job.poll() is None:
        time.sleep(0.002)
    if job.poll() is not None:
        return time.monotonic() - began
    kill(job)
    job.communicate()
    return None


def kill_often(whole, folder, times: int, seed: int) -> int:
    """Kill runs at random instants, restarting each time, until so many kills are done.

    Number of runs that came to their end.
    """
    scene, expected, seconds = whole
    chance = random.Random(seed)
    kills, finished, output = 0, 0, folder / "run-0"
    while kills < times or finished == 0:
        more = ["--restart"] if (output / "checkpoint.h5").exists() else []
        job = start([scene, "-q", "-o", output, *more], RANKS)
        # mostly while it computes and writes, sometimes while it starts
        starting = chance.random() < 0.2
        lifetime = chance.uniform(0.2, 3.0 if kills == 0 else 0.6) if starting else chance.uniform(0.0, seconds)
        if kills < times:
            lasted = seconds_until_killed(job, output, lifetime, starting)
            if lasted is None:
                kills += 1
                wait_until_free(output)
                continue
            # the first run may have compiled and lasted longer than later ones do
            seconds = min(seconds, lasted)
        result = finish(job)
        assert result.status == 0, result.err
        assert_same_bits(output, expected)
        finished += 1
        output = folder / f"run-{finished}"
    return finished


def test_five_kills(whole, tmp_path):
    assert state(whole[1])[0]["step"] > 40
    assert kill_often(whole, tmp_path, 5, seed=1) >= 1


@pytest.mark.long
def test_thirty_kills(whole, tmp_path):
    assert kill_often(whole, tmp_path, MANY, seed=7) >= 1


def test_a_kill_within_an_iteration_of_newton(tmp_path):
    """An equilibrium of a body that flows between dies that rub goes on from the last one that was written."""
    scene = write(between_dies(METAL) | {"output": {"checkpoint_steps": 1}}, tmp_path / "scene.toml")
    killed = [tmp_path / str(number) for number in (61, 100)]
    for folder in killed:
        program = ("-c", KILLED.format(corrections=folder.name))
        ended = finish(start(["run", scene, "-q", "-o", folder], RANKS, program=program))
        assert ended.status != 0 and "Traceback" not in ended.err
        wait_until_free(folder)
    written = [state(folder)[0]["step"] for folder in killed]
    again = [[scene, "-q", "-o", folder, "--restart"] for folder in killed]
    all_done(many([[scene, "-q", "-o", tmp_path / "whole"], *again], RANKS, tmp_path / "job"))
    assert 0 < written[0] < written[1] < state(tmp_path / "whole")[0]["step"]
    for folder in killed:
        assert_same_bits(folder, tmp_path / "whole")
