"""Checkpoints: bitwise round trips on any number of ranks, replacement that loses nothing, clear errors."""

import json
import os
import resource
import signal

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from parsolid.output import OutputError
from parsolid.output.checkpoint import (
    find_checkpoint,
    partial_name,
    previous_name,
    read_checkpoint,
    write_checkpoint,
)
from parsolid.output.slabs import SlabWriter, create_slab, open_serial, places
from parsolid.per_rank import own_share

HEADER = {"step": 7, "time": 0.1 + 0.2, "title": "Säule", "nested": {"list": [1.5, None]}}


def same_bits(one, other):
    return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()


def step_of(comm, path):
    return read_checkpoint(comm, path)[0]["step"]


def test_another_number_of_ranks_gets_even_contiguous_shares(comm, shared_path, fields, pieces):
    write_checkpoint(comm, shared_path / "checkpoint.h5", HEADER, [fields])
    alone = read_checkpoint(MPI.COMM_SELF, shared_path / "checkpoint.h5")[1][0]
    assert np.array_equal(alone["identifier"], np.arange(pieces[0]))
    assert np.array_equal(alone["momentum"], np.arange(pieces[0])[:, np.newaxis] * np.pi + np.arange(6))
    if comm.rank == 0:
        write_checkpoint(MPI.COMM_SELF, shared_path / "alone.h5", HEADER, [alone], np.array([3.0]))
    comm.Barrier()
    _, (shares,), per_rank = read_checkpoint(comm, shared_path / "alone.h5")
    count = len(shares["jacobian"])
    assert abs(count - pieces[0] / comm.size) < 1.0
    first = comm.exscan(count) or 0
    assert same_bits(shares["momentum"], alone["momentum"][first : first + count])
    assert comm.allreduce(count) == pieces[0] and np.array_equal(per_rank, [[3.0]])


@pytest.mark.parametrize("written", [1, 2, 3])
def test_sums_of_ranks_are_kept_on_another_number(comm, written):
    rows = np.arange(2.0 * written).reshape(written, 2)
    np.testing.assert_array_equal(comm.allreduce(own_share(comm, rows)), rows.sum(axis=0))


def test_rows_are_written_in_pieces_of_a_few_bytes(comm, shared_path, fields, pieces):
    path = shared_path / "slabs.h5"
    if comm.rank == 0:
        with open_serial(path, "w") as file:
            create_slab(file, "momentum", (pieces[0], 6), np.float32)
    comm.Barrier()
    with SlabWriter(comm, path, places(path), piece_bytes=50) as writer:
        writer.write("momentum", pieces[1], fields["momentum"])
    with open_serial(path, "r") as file:
        expected = np.arange(pieces[0])[:, np.newaxis] * np.pi + np.arange(6)
        assert np.array_equal(file["momentum"][()], expected.astype(np.float32))


def test_the_newest_whole_file_is_found_wherever_the_run_was_killed(comm, shared_path, fields):
    path = shared_path / "checkpoint.h5"
    for step in range(3):
        write_checkpoint(comm, path, {"step": step}, [fields])
    assert step_of(comm, path) == 2 and step_of(comm, previous_name(path)) == 1
    assert not partial_name(path).exists() and find_checkpoint(shared_path, comm) == path
    comm.Barrier()
    if comm.rank == 0:
        # killed between the two renames
        os.replace(path, partial_name(path))
    comm.Barrier()
    assert step_of(comm, find_checkpoint(shared_path, comm)) == 2
    # going on from there must not overwrite the only newest file before the next is whole
    write_checkpoint(comm, path, {"step": 3}, [fields])
    assert step_of(comm, path) == 3 and step_of(comm, previous_name(path)) == 2
    comm.Barrier()
    if comm.rank == 0:
        with open(path, "r+b") as file:
            file.truncate(path.stat().st_size // 2)
        partial_name(path).write_bytes(b"half a header")
    comm.Barrier()
    assert find_checkpoint(shared_path, comm) == previous_name(path)


def test_other_files_are_refused_by_name(comm, shared_path, fields):
    if comm.rank == 0:
        (shared_path / "text.h5").write_text("no HDF5")
        h5py.File(shared_path / "other.h5", "w").close()
    comm.Barrier()
    for name in ("text.h5", "other.h5"):
        with pytest.raises(OutputError, match=name):
            read_checkpoint(comm, shared_path / name)
    # nor is a folder that does not exist
    with pytest.raises(OutputError, match="checkpoint.h5"):
        write_checkpoint(comm, shared_path / "missing" / "checkpoint.h5", HEADER, [fields])


@pytest.mark.parametrize(
    "spoil",
    [
        lambda fields: fields.update(jacobian=np.zeros(99)),
        lambda fields: fields.update(jacobian=fields["jacobian"].astype(np.complex128)),
        lambda fields: fields.clear(),
    ],
)
def test_arrays_that_do_not_fit_on_one_rank_are_an_error_on_all(comm, shared_path, fields, spoil):
    if comm.rank == comm.size - 1:
        spoil(fields)
    with pytest.raises(OutputError, match="expected"):
        write_checkpoint(comm, shared_path / "checkpoint.h5", HEADER, [fields])


@pytest.fixture
def small_files():
    """A function that lets this rank write no file beyond 300 kB, as on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, limits[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    signal.signal(signal.SIGXFSZ, handler)


def test_a_disk_that_fills_while_writing_is_an_error_on_all_ranks(comm, shared_path, small_files, monkeypatch):
    path = shared_path / "checkpoint.h5"
    write_checkpoint(comm, path, {"step": 1}, [{"x": np.zeros(10)}])
    write = SlabWriter.write

    def write_on_full_disk(self, *arguments):
        small_files()
        write(self, *arguments)

    monkeypatch.setattr(SlabWriter, "write", write_on_full_disk)
    with pytest.raises(OutputError, match="cannot write .*checkpoint.h5"):
        write_checkpoint(comm, path, {"step": 2}, [{"x": np.zeros(100_000)}])
    assert step_of(comm, find_checkpoint(shared_path, comm)) == 1


class _Short:
    """A file of which a write reports success and takes nothing."""

    def Write_at(self, offset, buffer, status):
        pass

    def Close(self):
        pass

    Write_at_all = Write_at


def test_a_write_that_is_short_without_an_error_is_one_on_all_ranks(comm, shared_path, fields, monkeypatch):
    path = shared_path / "checkpoint.h5"
    write_checkpoint(comm, path, {"step": 1}, [fields])
    monkeypatch.setattr(SlabWriter, "_open", lambda self: setattr(self, "_file", _Short()))
    with pytest.raises(OutputError, match="only 0 of .* bytes written"):
        write_checkpoint(comm, path, {"step": 2}, [fields])
    assert step_of(comm, find_checkpoint(shared_path, comm)) == 1


def test_a_disk_too_full_to_begin_is_an_error_on_all_ranks(comm, shared_path, small_files):
    path = shared_path / "checkpoint.h5"
    write_checkpoint(comm, path, {"step": 1}, [{"x": np.zeros(10)}])
    small_files()
    with pytest.raises(OutputError, match="File too large"):
        write_checkpoint(comm, path, {"step": 2}, [{"x": np.zeros(100_000)}])
    assert step_of(comm, find_checkpoint(shared_path, comm)) == 1


def test_the_header_takes_numpy_values_and_is_text_in_the_file(comm, shared_path):
    write_checkpoint(
        comm, shared_path / "c.h5", {"t": np.float64(0.1), "a": np.arange(3)}, [{"x": np.zeros(comm.rank)}]
    )
    with h5py.File(shared_path / "c.h5", "r") as file:
        assert json.loads(file["header"].asstr()[()]) == {"t": 0.1, "a": [0, 1, 2]}


def test_before_the_first_checkpoint_it_is_told_that_there_is_none(comm, shared_path):
    for folder in (shared_path, shared_path / "nowhere"):
        with pytest.raises(OutputError, match=f"no checkpoint was written yet in {folder}:"):
            find_checkpoint(folder, comm)
    if comm.rank == 0:
        (shared_path / "checkpoint.h5.partial").write_bytes(b"begun")
    comm.Barrier()
    with pytest.raises(OutputError, match="partial: .*previous.h5: "):
        find_checkpoint(shared_path, comm)
