"""The output directory: older results are never lost."""

import itertools
import os
import subprocess

import numpy as np
import pytest

from parsolid.output import OutputError
from parsolid.output.checkpoint import find_checkpoint, read_checkpoint, write_checkpoint
from parsolid.output.run_folder import occupy, prepare


def fill(comm, directory, names, text="old"):
    if comm.rank == 0:
        directory.mkdir(exist_ok=True)
        for name in names:
            (directory / name).write_text(text)
    comm.Barrier()


def listing(comm, directory):
    comm.Barrier()
    found = {str(path.relative_to(directory)): path.read_text() for path in directory.rglob("*") if path.is_file()}
    comm.Barrier()
    return found


def test_a_new_run_moves_older_results_aside_each_time(comm, shared_path):
    directory = shared_path / "a" / "out"
    assert prepare(comm, directory) == directory and directory.is_dir()
    results = ["history.csv", "history.sums", "fields.vtkhdf", "fields.1.vtkhdf", "fields_rubber.vtkhdf"]
    results += ["checkpoint.h5", "checkpoint.h5.partial", "summary.json"]
    fill(comm, directory, [*results, "notes.txt"])
    fill(comm, directory / "pictures", ["energies.png"])
    prepare(comm, directory, continuing=True)
    kept = ["pictures/energies.png", *results]
    assert listing(comm, directory) == dict.fromkeys([*kept, "notes.txt"], "old")
    prepare(comm, directory)
    assert listing(comm, directory) == {**{f"previous-1/{name}": "old" for name in kept}, "notes.txt": "old"}
    fill(comm, directory, ["history.csv"], "newer")
    prepare(comm, directory)
    assert listing(comm, directory)["previous-2/history.csv"] == "newer"
    assert listing(comm, directory)["previous-1/history.csv"] == "old"


def test_a_file_in_the_place_of_the_directory_is_one_error_on_all_ranks(comm, shared_path):
    fill(comm, shared_path, ["out"])
    with pytest.raises(OutputError, match="cannot write to the directory .*out"):
        prepare(comm, shared_path / "out")


def test_a_file_that_the_run_reads_is_never_in_the_way_silently(comm, shared_path, monkeypatch):
    """By any name: a relative path, or a link in either place."""
    fill(comm, shared_path / "out", ["scene.toml", "history.csv"])
    if comm.rank == 0:
        (shared_path / "link").symlink_to(shared_path / "out")
        (shared_path / "linked.toml").symlink_to(shared_path / "out" / "scene.toml")
    comm.Barrier()
    monkeypatch.chdir(shared_path)
    names = ("out/scene.toml", "link/scene.toml", "linked.toml", "out/../out/scene.toml")
    for folder, name in itertools.product(("out", "link"), names):
        for continuing in (False, True):
            with pytest.raises(OutputError, match="scene.toml is read by this run"):
                prepare(comm, folder, continuing, inputs=(name,))
    assert listing(comm, shared_path / "out") == {"scene.toml": "old", "history.csv": "old"}


def test_what_a_link_points_to_is_not_written_over(comm, shared_path):
    """Results that are links into another folder are moved aside as links; what is there stays."""
    fill(comm, shared_path / "other", ["history.csv", "checkpoint.h5"], "precious")
    if comm.rank == 0:
        (shared_path / "out").mkdir()
        for name in ("history.csv", "checkpoint.h5"):
            (shared_path / "out" / name).symlink_to(shared_path / "other" / name)
        (shared_path / "out" / "summary.json").symlink_to(shared_path / "nowhere")
    comm.Barrier()
    prepare(comm, shared_path / "out")
    assert set(listing(comm, shared_path / "other").values()) == {"precious"}
    left = comm.bcast(sorted(path.name for path in (shared_path / "out").iterdir()))
    assert left == ["previous-1"]


def test_a_link_in_the_place_of_a_file_that_is_written_beside_is_taken_away(comm, shared_path):
    """A run that goes on puts new files in the place of links; one beside them would be written through."""
    fill(comm, shared_path / "other", ["precious"], "precious")
    fill(comm, shared_path / "out", ["history.csv", "summary.json.partial"])
    if comm.rank == 0:
        for name in ("checkpoint.h5.partial", "history.csv.partial"):
            (shared_path / "out" / name).symlink_to(shared_path / "other" / "precious")
    comm.Barrier()
    prepare(comm, shared_path / "out", continuing=True)
    assert set(listing(comm, shared_path / "out")) == {"history.csv", "summary.json.partial"}
    write_checkpoint(comm, shared_path / "out" / "checkpoint.h5", {"step": 1}, [{"x": np.zeros(3)}])
    assert listing(comm, shared_path / "other") == {"precious": "precious"}


@pytest.fixture
def disk(comm, shared_path):
    """A folder, and what makes it one that nobody may write to, the user that may do all included."""
    place = shared_path / "disk"

    def mount(*options):
        return subprocess.run(["mount", *options, place], capture_output=True).returncode == 0

    made = comm.rank == 0 and os.geteuid() == 0 and not place.mkdir() and mount("-t", "tmpfs", "tmpfs")
    if not comm.bcast(made):
        pytest.skip("mounting needs root")
    yield place, lambda: comm.bcast(comm.rank == 0 and mount("-o", "remount,ro"))
    comm.Barrier()
    if comm.rank == 0:
        subprocess.run(["umount", "-l", place], check=True)


def test_a_folder_that_may_only_be_read_is_one_error_on_all_ranks(comm, disk):
    place, lock = disk
    write_checkpoint(comm, place / "checkpoint.h5", {"step": 1}, [{"x": np.zeros(3)}])
    assert lock()
    for attempt in (occupy, lambda *at: prepare(*at, True), lambda comm, at: prepare(comm, at / "a")):
        with pytest.raises(OutputError, match="disk.*(Read-only|denied)") as caught:
            attempt(comm, place)
        assert set(comm.allgather(str(caught.value))) == {str(caught.value)}
    with pytest.raises(OutputError, match="Read-only"):
        write_checkpoint(comm, place / "checkpoint.h5", {"step": 2}, [{"x": np.zeros(3)}])
    assert read_checkpoint(comm, find_checkpoint(place, comm))[0]["step"] == 1
