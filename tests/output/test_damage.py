"""Damaged checkpoints: no changed number is read, whatever is damaged on whatever ranks, and one message says what."""

import os
import random
import shutil

import h5py
import numpy as np
import pytest
from flipped_bits import flip

from parsolid.output import OutputError, checkpoint
from parsolid.output.checkpoint import find_checkpoint, previous_name, read_checkpoint, write_checkpoint
from parsolid.output.slabs import open_serial, places
from parsolid.simulation.restart import Restart

HEADER = {"step": 7, "time": 0.3, "title": "Säule", "ranks": 3}
FLIPS = 300


@pytest.fixture
def whole(comm, shared_path, fields):
    path = shared_path / "checkpoint.h5"
    write_checkpoint(comm, path, HEADER, [fields, {"mass": fields["jacobian"]}], np.array([1.0, comm.rank]))
    return path


def on_one_rank(comm, change, *arguments) -> None:
    """Rank 0 changes a file when all are done with it, and the others wait."""
    comm.Barrier()
    if comm.rank == 0:
        change(*arguments)
    comm.Barrier()


def content(comm, path):
    """All that is read: header, fields, rows of the ranks, as bytes."""
    header, systems, rows = read_checkpoint(comm, path)
    return (
        header,
        [{name: (v.dtype.str, v.tobytes()) for name, v in fields.items()} for fields in systems],
        rows.tobytes(),
    )


@pytest.mark.slow
def test_a_flipped_bit_anywhere_changes_nothing_or_is_refused(comm, whole):
    """Of many single bits in all of the file some change nothing (gaps, HDF5's own marks); none changes a number."""
    expected, chance, refused = content(comm, whole), random.Random(3), 0
    size = whole.stat().st_size
    for _ in range(FLIPS):
        place, bit = chance.randrange(size), chance.randrange(8)
        on_one_rank(comm, flip, whole, place, bit)
        try:
            found = content(comm, whole)
        except OutputError:
            refused += 1
        else:
            assert found == expected, f"bit {bit} of byte {place}"
        on_one_rank(comm, flip, whole, place, bit)
    assert content(comm, whole) == expected and refused > FLIPS // 20


def test_every_bit_of_a_number_counts(comm, whole):
    laid = places(whole)
    for name in ("particles/momentum", "particles/body", "particles/broken", "particles_1/mass", "ranks/values"):
        size = int(np.prod(laid[name].shape)) * np.dtype(laid[name].dtype).itemsize
        for place, bit in ((0, 0), (size // 2, 3), (size - 1, 7)):
            on_one_rank(comm, flip, whole, laid[name].offset + place, bit)
            with pytest.raises(OutputError, match=f"checkpoint.h5: damaged: {name} not as written"):
                read_checkpoint(comm, whole)
            comm.Barrier()
            on_one_rank(comm, flip, whole, laid[name].offset + place, bit)


def test_damage_that_two_ranks_find_is_one_message(comm, whole):
    """Bits of what the first and the last rank read, in two fields and both files of a folder."""
    laid, names = places(whole), ("particles/momentum", "particles/jacobian")
    on_one_rank(comm, shutil.copy, whole, previous_name(whole))
    for path in (whole, previous_name(whole)):
        for name, end in zip(names, (0, -1)):
            size = int(np.prod(laid[name].shape)) * 8
            on_one_rank(comm, flip, path, laid[name].offset + end % size, 2)
    with pytest.raises(OutputError, match="checkpoint.h5: damaged: .*jacobian.*momentum") as caught:
        Restart(comm, whole)
    assert set(comm.allgather(str(caught.value))) == {str(caught.value)} and "one before" not in str(caught.value)
    # one that is whole is offered
    write_checkpoint(comm, whole.with_name("other.h5"), HEADER | {"time": 0.2}, [{"x": np.zeros(2)}])
    on_one_rank(comm, os.replace, whole.with_name("other.h5"), previous_name(whole))
    with pytest.raises(OutputError, match="the one before is whole: --restart .*previous.h5 goes on from t = 0.2 s"):
        Restart(comm, whole)


def test_errors_of_the_disk_on_two_ranks_are_one_message(comm, whole, monkeypatch):
    opened = checkpoint.open_serial

    def broken(path, mode, *more):
        if mode == "r" and broken.armed:
            raise OSError(5, "Input/output error")
        return opened(path, mode, *more)

    # rank 0 alone reads the layout first, then all read their rows
    broken.armed = comm.rank > 0 or comm.size == 1
    monkeypatch.setattr(checkpoint, "open_serial", broken)
    with pytest.raises(OutputError, match="Input/output error") as caught:
        read_checkpoint(comm, whole)
    assert set(comm.allgather(str(caught.value))) == {str(caught.value)}


def edit(path, change) -> None:
    with open_serial(path, "r+") as file:
        change(file)


def _without(name, value=None):
    def change(file):
        del file[name]
        if value is not None:
            file[name] = value

    return change


def _other_shares(file):
    file["ranks/offset"].write_direct(np.full_like(file["ranks/offset"][()], 7))


def _a_group(file):
    del file["ranks/values"]
    file.create_group("ranks/values")


# what is done to a file, and a part of it that the message names
MISSHAPEN = {
    "no header": (_without("header"), "header"),
    "another header": (_without("header", '{"step": 8}'), "header"),
    "header that is no text": (_without("header", 3.0), "header"),
    "no checksums": (_without("checksums"), "checksums"),
    "checksums of something else": (_without("checksums", b"0\n{}"), "checksums"),
    "no field": (_without("particles/momentum"), "particles/momentum"),
    "field of another shape": (_without("particles/jacobian", np.ones(5)), "particles/jacobian"),
    "field of another type": (_without("particles/identifier", np.zeros(23, np.float32)), "<i8 .*, found <f4"),
    "field read the other way round": (_without("particles/jacobian", np.zeros(23, ">f8")), "<f8 .*, found >f8"),
    "a field more": (lambda file: file.create_dataset("particles/more", data=np.ones(23)), "particles/more"),
    "field that is a group": (_a_group, "ranks/values"),
    "no particles": (_without("particles"), "particles"),
    "no second particles": (_without("particles_1"), "particles_1/mass"),
    "no ranks": (_without("ranks"), "ranks/offset"),
    "other shares": (_other_shares, "offset"),
    "link to nowhere": (_without("particles/body", h5py.SoftLink("/nowhere")), "particles/body"),
    "not written to its end": (lambda file: file.attrs.modify("complete", 0), "end"),
    "another version": (lambda file: file.attrs.modify("version", 1), "expected 4, found 1"),
}


@pytest.mark.parametrize("name", MISSHAPEN)
def test_missing_or_misshapen_content_is_one_message_on_all_ranks(comm, whole, name):
    change, words = MISSHAPEN[name]
    on_one_rank(comm, edit, whole, change)
    with pytest.raises(OutputError, match=words) as caught:
        read_checkpoint(comm, whole)
    assert set(comm.allgather(str(caught.value))) == {str(caught.value)} and "\n" not in str(caught.value)


def test_a_truncated_file_is_refused_at_every_length(comm, whole):
    data = whole.read_bytes()
    for length in (0, 7, 100, 2000, len(data) // 2, len(data) - 9):
        on_one_rank(comm, whole.write_bytes, data[:length])
        with pytest.raises(OutputError):
            read_checkpoint(comm, whole)


def test_the_newest_whole_file_goes_before_the_others_in_this_order(comm, shared_path, fields):
    """checkpoint.h5.partial, when it is whole, then checkpoint.h5, then checkpoint.previous.h5."""
    names = ("checkpoint.previous.h5", "checkpoint.h5", "checkpoint.h5.partial")
    for step, name in enumerate(names):
        write_checkpoint(comm, shared_path / "one.h5", {"step": step}, [fields])
        on_one_rank(comm, os.replace, shared_path / "one.h5", shared_path / name)
        assert find_checkpoint(shared_path, comm).name == name


def test_hdf5_checks_what_it_keeps_itself(whole):
    """With its first format a flipped bit in a type, or on the heap of texts, could end the process."""
    with h5py.File(whole) as file:
        assert file.id.get_create_plist().get_version()[0] == 2
        assert file.attrs.get_id("format").dtype.kind == "S"
