"""The lock on the folder of a run: one run at a time, and none in the way that has ended."""

import errno
import fcntl
import json
import os
import platform
import signal
import subprocess
import sys

import pytest
from mpi_launch import clean_environment

from parsolid.output import OutputError
from parsolid.output.lock import NAME, FolderLock
from parsolid.output.run_folder import occupy

HOLDER = """
import sys, time
from pathlib import Path
from parsolid.output.lock import FolderLock
lock = FolderLock(Path(sys.argv[1]))
print("locked", flush=True)
time.sleep(60)
"""


@pytest.fixture
def other(tmp_path):
    """Another process that has locked tmp_path."""
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=clean_environment())
    assert process.stdout.readline() == "locked\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_second_run_is_refused_with_the_name_of_the_first(tmp_path, other, monkeypatch):
    with pytest.raises(OutputError, match="found another run that writes there") as caught:
        FolderLock(tmp_path)
    assert f"host {platform.node()}, process {other.pid}" in str(caught.value)
    assert json.loads((tmp_path / NAME).read_text())["process"] == other.pid
    # another folder is another matter
    (tmp_path / "b").mkdir()
    monkeypatch.setenv("SLURM_JOB_ID", "77")
    lock = FolderLock(tmp_path / "b")
    with pytest.raises(OutputError, match="job 77"):
        FolderLock(tmp_path / "b")
    lock.release()


def test_a_killed_run_is_not_in_the_way(tmp_path, other):
    other.send_signal(signal.SIGKILL)
    other.wait()
    assert (tmp_path / NAME).exists()
    lock = FolderLock(tmp_path)
    assert json.loads((tmp_path / NAME).read_text())["process"] == os.getpid()
    lock.release()
    lock.release()
    assert not (tmp_path / NAME).exists()


def test_a_lock_that_nobody_refers_to_is_given_back(tmp_path):
    lock = FolderLock(tmp_path)
    del lock
    FolderLock(tmp_path).release()


def test_a_file_removed_while_it_was_opened_is_no_lock(tmp_path, monkeypatch):
    """The run before ends between the opening of its file and the lock on it."""
    before, taken = FolderLock(tmp_path), []

    def late(descriptor, operation):
        if not taken:
            before.release()
        taken.append(descriptor)

    monkeypatch.setattr(fcntl, "flock", late)
    lock = FolderLock(tmp_path)
    assert len(taken) == 2 and os.fstat(lock._file.fileno()).st_ino == (tmp_path / NAME).stat().st_ino
    lock.release()


def test_all_ranks_hear_that_a_folder_is_taken(comm, shared_path):
    lock = occupy(comm, shared_path / "out")
    assert (lock is not None) == (comm.rank == 0)
    with pytest.raises(OutputError, match="another run that writes there"):
        occupy(comm, shared_path / "out")
    if lock is not None:
        lock.release()


@pytest.fixture
def without_locks(monkeypatch):
    """A file system that knows no locks."""

    def fail(descriptor, operation):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", fail)
    monkeypatch.setenv("SLURM_JOB_ID", "12")


OWNERS = {
    "of this machine, alive": ({"process": os.getppid()}, True),
    "of this machine, dead": ({"process": 2**22 + 1}, False),
    "of another machine": ({"host": "elsewhere", "process": 1, "job": "11"}, True),
    "of an earlier start of this job": ({"host": "elsewhere", "process": 1, "job": "12"}, False),
    "without a name": (None, False),
}


@pytest.mark.parametrize("name", OWNERS)
def test_without_locks_the_process_in_the_file_counts(tmp_path, without_locks, name):
    owner, alive = OWNERS[name]
    text = "half a li" if owner is None else json.dumps({"host": platform.node()} | owner)
    (tmp_path / NAME).write_text(text)
    if alive:
        with pytest.raises(OutputError, match=f"if that run has ended, remove .*{NAME}"):
            FolderLock(tmp_path)
        assert (tmp_path / NAME).read_text() == text
    else:
        FolderLock(tmp_path).release()
        assert not (tmp_path / NAME).exists()
