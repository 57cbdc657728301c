"""Killed at random instants: a whole checkpoint and a readable field series are always there."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from endless_writer import PARTICLES, state
from mpi4py import MPI
from mpi_launch import start

from parsolid.output import OutputError, vtkhdf
from parsolid.output.checkpoint import find_checkpoint, read_checkpoint

KILLS = 12


def written(directory: Path) -> tuple[int, int] | None:
    """What tells one checkpoint from the next; None while there is none."""
    try:
        found = (directory / "checkpoint.h5").stat()
    except FileNotFoundError:
        return None
    return found.st_ino, found.st_mtime_ns


def start_writer(directory: Path, ranks: int, wanted_by: int) -> subprocess.Popen:
    """The writer, which ends when the process that wants it has."""
    return start([Path(__file__).with_name("endless_writer.py"), directory, wanted_by], ranks)


def run_until_killed(directory: Path, ranks: int, checkpoints: int, lifetime: float) -> None:
    """Start the writer and kill all its processes so long [s] after it has begun and written so many checkpoints."""
    processes = directory / "processes"
    processes.unlink(missing_ok=True)
    seen = {None, written(directory)}
    wanted = len(seen) + checkpoints
    job = start_writer(directory, ranks, os.getpid())
    try:
        end = time.monotonic() + 60.0
        while not processes.exists():
            assert job.poll() is None and time.monotonic() < end, "the writer did not start"
            time.sleep(0.002)
        while len(seen) < wanted:
            assert job.poll() is None and time.monotonic() < end, "the writer did not write"
            time.sleep(0.002)
            seen.add(written(directory))
        time.sleep(lifetime)
        for number in processes.read_text().split():
            os.kill(int(number), signal.SIGKILL)
    finally:
        os.killpg(job.pid, signal.SIGKILL)
        job.wait()


def check_checkpoint(directory: Path) -> int:
    header, (fields,), rows = read_checkpoint(MPI.COMM_SELF, find_checkpoint(directory))
    expected = state(header["step"], fields["identifier"])
    assert np.array_equal(np.sort(fields["identifier"]), np.arange(PARTICLES))
    assert all(fields[name].tobytes() == np.ascontiguousarray(expected[name]).tobytes() for name in expected)
    assert np.array_equal(rows[:, 0], header["step"] + np.arange(len(rows)) / 7.0)
    return header["step"]


def check_fields(path: Path) -> np.ndarray:
    """The times of a series [s]; every step in it holds what it must."""
    layout, times = vtkhdf.published(path)
    number = np.arange(PARTICLES)
    with h5py.File(path, "r") as file:
        steps = file["VTKHDF/Steps"]
        assert steps.attrs["NSteps"] == len(times) == len(steps["Values"])
        for index, at in enumerate(times):
            expected = state(round(2 * at), number)
            rows = slice(steps["PointOffsets"][index], steps["PointOffsets"][index] + PARTICLES)
            assert np.array_equal(file["VTKHDF/Points"][rows], expected["position"])
            assert np.array_equal(file["VTKHDF/PointData/jacobian"][rows], expected["jacobian"].astype(np.float32))
            assert np.array_equal(file["VTKHDF/PointData/identifier"][()], number)
    return times


@pytest.mark.slow
@pytest.mark.serial
def test_every_kill_leaves_a_whole_checkpoint_and_readable_fields(tmp_path):
    random.seed(11)
    step, seen = 0, set()
    for kill in range(KILLS):
        # the last ones on another number of ranks, continuing what the others wrote
        run_until_killed(tmp_path, 2 if kill < KILLS - 5 else 3, kill % 3, random.uniform(0.0, 0.3))
        if step == 0 and not any(tmp_path.glob("checkpoint*.h5")):
            continue  # killed before the first was whole
        newest = check_checkpoint(tmp_path)
        assert newest >= step
        step = newest
        seen.add(find_checkpoint(tmp_path).name)
        check_fields(tmp_path / "fields.vtkhdf")
    assert step >= KILLS and "checkpoint.h5" in seen
    # all that was written is still there: every step once or, where a run was killed between the two files, twice
    times = np.concatenate([check_fields(path) for path in tmp_path.glob("fields*.vtkhdf")])
    assert set(0.5 * np.arange(1, step + 1)) <= set(times)


@pytest.mark.serial
def test_the_writer_ends_with_who_wants_it(tmp_path):
    """A test that is itself killed leaves no writer behind."""
    waiting = subprocess.Popen([sys.executable, "-S", "-c", "input()"], stdin=subprocess.PIPE)
    job = start_writer(tmp_path, 2, waiting.pid)
    try:
        end = time.monotonic() + 60.0
        while written(tmp_path) is None:
            assert job.poll() is None and time.monotonic() < end, "the writer did not write"
            time.sleep(0.002)
        waiting.kill()
        # until it is waited for, a process that has ended still has its number
        waiting.wait()
        assert job.wait(30.0) != 0
    finally:
        waiting.kill()
        if job.poll() is None:
            os.killpg(job.pid, signal.SIGKILL)
            job.wait()


def test_before_the_first_checkpoint_it_is_told_that_there_is_none(comm, shared_path):
    with pytest.raises(OutputError, match="^no checkpoint was written yet in .*: the run there ended before its first"):
        find_checkpoint(shared_path, comm)
    with pytest.raises(OutputError, match="yet in .*nowhere: there is no such folder; start it without --restart, or"):
        find_checkpoint(shared_path / "nowhere", comm)
    if comm.rank == 0:
        (shared_path / "checkpoint.h5.partial").write_bytes(b"begun")
    comm.Barrier()
    with pytest.raises(
        OutputError, match="no whole checkpoint in .*partial: not a whole .*previous.h5: does not exist"
    ):
        find_checkpoint(shared_path, comm)
