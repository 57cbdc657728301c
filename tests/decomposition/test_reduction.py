"""Sums, and minima asked for ahead."""

import math

import numpy as np
import pytest

from decomposition.reduction import MinimumAhead, sums


def test_sums(comm):
    np.testing.assert_array_equal(sums(comm, [1.0, comm.rank]), [comm.size, comm.size * (comm.size - 1) / 2])
    assert sums(comm, np.int64(2)) == 2 * comm.size


def test_minimum_ahead(comm):
    minimum = MinimumAhead(comm, 2)
    for turn in range(3):
        assert not minimum.pending
        values = np.array([comm.rank + turn, -comm.rank], dtype=float)
        minimum.begin(values)
        values[:] = -99.0
        assert minimum.pending
        np.testing.assert_array_equal(minimum.result(), [turn, 1 - comm.size])


def test_minimum_of_not_a_number_is_seen_by_all(comm):
    minimum = MinimumAhead(comm, 1)
    minimum.begin([math.nan if comm.rank == comm.size - 1 else 1.0])
    assert minimum.result()[0] == -math.inf


def test_minimum_out_of_turn_is_refused(comm):
    minimum = MinimumAhead(comm, 1)
    with pytest.raises(RuntimeError, match="none pending"):
        minimum.result()
    minimum.begin([1.0])
    with pytest.raises(RuntimeError, match="found it pending"):
        minimum.begin([1.0])
    minimum.result()
