"""The history: the same bits when read back, nothing doubled or lost by a restart."""

import math

import numpy as np
import pytest

from parsolid.output import OutputError
from parsolid.output.history import History, read_history

COLUMNS = ["step", "time", "kinetic", "tip.displacement"]


def rows(count):
    random = np.random.default_rng(3)
    return [[step, step * 0.1, np.float64(random.standard_normal() * 10.0**step), None] for step in range(count)]


def write(path, table, resume_at=None):
    history = History(path, COLUMNS)
    if resume_at is not None:
        history.resume(resume_at)
    for row in table:
        history.append(row)
    return history


@pytest.mark.serial
class TestHistory:
    def test_numbers_are_read_back_bit_for_bit(self, tmp_path):
        table = rows(20)
        open_still = write(tmp_path / "history.csv", table)
        found = read_history(tmp_path / "history.csv")
        assert list(found) == COLUMNS
        assert found["kinetic"] == [row[2] for row in table] and found["time"] == [row[1] for row in table]
        assert all(map(math.isnan, found["tip.displacement"]))
        open_still.close()

    def test_a_resumed_history_equals_an_uninterrupted_one(self, tmp_path):
        table = rows(10)
        write(tmp_path / "whole.csv", table)
        write(tmp_path / "history.csv", table[:8])
        with open(tmp_path / "history.csv", "a") as file:
            file.write("8,0.8")  # killed within a row
        write(tmp_path / "history.csv", table[6:], resume_at=5)
        assert (tmp_path / "history.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()

    def test_every_flipped_bit_is_found(self, tmp_path):
        path = tmp_path / "history.csv"
        write(path, rows(6)).close()
        whole, random = path.read_bytes(), np.random.default_rng(5)
        for place in random.choice(len(whole), 40, replace=False):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << int(random.integers(8))
            path.write_bytes(damaged)
            with pytest.raises(OutputError):
                read_history(path)
            with pytest.raises(OutputError):
                write(path, [], resume_at=3)
        path.write_bytes(whole)
        assert read_history(path)["step"] == list(range(6))

    def test_a_row_whose_checksum_was_not_written_any_more_is_read(self, tmp_path):
        path, sums = tmp_path / "history.csv", tmp_path / "history.sums"
        write(path, rows(4)).close()
        sums.write_text("".join(sums.read_text().splitlines(keepends=True)[:-1]))
        assert len(read_history(path)["step"]) == 4
        sums.write_text("".join(sums.read_text().splitlines(keepends=True)[:-1]))
        with pytest.raises(OutputError):
            read_history(path)

    def test_resuming_without_a_file_begins_one(self, tmp_path):
        write(tmp_path / "history.csv", rows(2), resume_at=7)
        assert len(read_history(tmp_path / "history.csv")["step"]) == 2

    def test_a_file_with_other_columns_is_refused_and_kept(self, tmp_path):
        path = tmp_path / "history.csv"
        write(path, rows(4))
        before = path.read_bytes()
        with pytest.raises(OutputError, match="'strain_energy'.*'kinetic'"):
            History(path, ["step", "time", "strain_energy"]).resume(2)
        assert path.read_bytes() == before

    def test_faults_are_named(self, tmp_path):
        with pytest.raises(OutputError, match="missing/history.csv"):
            write(tmp_path / "missing" / "history.csv", rows(1))
        with pytest.raises(ValueError, match="found 2"):
            History(tmp_path / "history.csv", COLUMNS).append([1, 2.0])
        (tmp_path / "other.csv").write_text("a,b\n1,2\n")
        with pytest.raises(OutputError, match="not a history"):
            read_history(tmp_path / "other.csv")


def test_a_cell_that_is_no_number_is_told_with_its_line(tmp_path):
    """In a history without checksums, as one that somebody has edited."""
    path = tmp_path / "history.csv"
    path.write_text("step,time\n0,0.0\n1,0.x1\n")
    with pytest.raises(OutputError, match="line 3"):
        read_history(path)
    path.write_text("step,time\n0,0.0\nx,0.1\n")
    with pytest.raises(OutputError, match="line 3"):
        History(path, ["step", "time"]).resume(1)
