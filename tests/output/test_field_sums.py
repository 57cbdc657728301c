"""Damaged fields: no changed number is read, whichever bit is flipped, on any number of ranks that have written it."""

import contextlib
import random

import h5py
import numpy as np
import pytest
from flipped_bits import flip
from test_fields import TIMES, Particles

from parsolid.output import OutputError, vtkhdf
from parsolid.output.fields import FieldSeries, check_step, rows_of_step, sums_path
from parsolid.output.slabs import places
from parsolid.output.vtkhdf import pack

COUNT, CONSTANT = 29, ("VTKHDF/PointData/identifier", "VTKHDF/PointData/volume")


@pytest.fixture
def path(comm, shared_path):
    series = FieldSeries(comm, shared_path / "fields.vtkhdf", len(TIMES))
    for time in TIMES:
        Particles(comm).write(series, time)
    comm.Barrier()
    return series.path


def content(path):
    """All that is read, as bytes."""
    result = {}
    with h5py.File(path, "r", locking=False) as file:
        layout, times = vtkhdf.published(path)
        for name in ("VTKHDF/Points", *(f"VTKHDF/PointData/{one}" for one in layout.varying)):
            for step in range(len(times)):
                result[name, step] = rows_of_step(file, path, name, step, COUNT).tobytes()
        for name in CONSTANT:
            result[name, 0] = rows_of_step(file, path, name, 2, COUNT, True).tobytes()
    return result


def test_every_bit_of_a_field_counts(comm, path):
    expected = content(path)
    # nobody reads any more
    comm.Barrier()
    if comm.rank == 0:
        laid = places(path)
        for name, place in (("VTKHDF/Points", 24 * 40), ("VTKHDF/PointData/velocity", 12 * 90), (CONSTANT[1], 7)):
            flip(path, laid[name].offset + place, 3)
            with pytest.raises(OutputError):
                content(path)
            flip(path, laid[name].offset + place, 3)
        assert content(path) == expected
        # of the checksums, too
        size, chance = sums_path(path).stat().st_size, random.Random(5)
        for _ in range(50):
            place, bit = chance.randrange(size), chance.randrange(8)
            flip(sums_path(path), place, bit)
            with contextlib.suppress(OutputError):
                assert content(path) == expected
            flip(sums_path(path), place, bit)
        assert content(path) == expected
        pack(path, 1)
        assert content(path) == expected
    comm.Barrier()


def test_a_step_that_another_run_starts_from_is_compared(comm, path):
    if comm.rank == 0:
        check_step(path, 3, COUNT)
        flip(path, places(path)["VTKHDF/PointData/velocity"].offset + 12 * COUNT * 3 + 5, 0)
        with pytest.raises(OutputError):
            check_step(path, 3, COUNT)
        check_step(path, 2, COUNT)
        flip(path, places(path)[CONSTANT[1]].offset + 7, 3)
        with pytest.raises(OutputError):
            check_step(path, 2, COUNT)
    comm.Barrier()


def test_a_series_that_goes_on_has_the_checksums_of_what_it_keeps(comm, path):
    series = FieldSeries(comm, path, 4, resume_at=0.1)
    for time in (0.2, 0.7):
        Particles(comm).write(series, time)
    comm.Barrier()
    assert len(sums_path(path).read_text().splitlines()) == 4
    assert np.array_equal(vtkhdf.published(path)[1][2:], [0.2, 0.7])
    content(path)


def test_a_file_whose_data_sets_cannot_be_told_is_damaged(comm, path):
    comm.Barrier()
    if comm.rank == 0:
        described = np.flatnonzero(np.frombuffer(path.read_bytes(), np.uint8))
        chance, refused = random.Random(3), 0
        for place, bit in ((int(chance.choice(described)), chance.randrange(8)) for _ in range(100)):
            flip(path, place, bit)
            try:
                places(path)
            except OutputError:
                refused += 1
            flip(path, place, bit)
        assert refused
    comm.Barrier()


def test_a_series_without_checksums_gets_none(comm, path):
    comm.Barrier()
    if comm.rank == 0:
        sums_path(path).unlink()
    comm.Barrier()
    series = FieldSeries(comm, path, 4, resume_at=0.1)
    Particles(comm).write(series, 0.5)
    comm.Barrier()
    assert not sums_path(path).exists()
    content(path)
