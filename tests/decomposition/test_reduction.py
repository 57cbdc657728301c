"""Sums, sums with fixed bits, and minima asked for ahead."""

import math

import numpy as np
import pytest

from decomposition import MinimumAhead, ordered_sum, sums
from decomposition.reduction import _LIMBS, _accumulate, _rounded


def test_sums(comm):
    np.testing.assert_array_equal(sums(comm, [1.0, comm.rank]), [comm.size, comm.size * (comm.size - 1) / 2])
    assert sums(comm, np.int64(2)) == 2 * comm.size


def wild(count):
    random = np.random.default_rng(1)
    return random.standard_normal(count) * 10.0 ** random.integers(-300, 300, count)


@pytest.mark.parametrize("values", [wild(3000), np.random.default_rng(2).random(3000), np.tile([1e16, 1.0, -1e16], 99)])
def test_ordered_sum_is_the_exact_sum_rounded(comm, values):
    exact = math.fsum(values)
    assert ordered_sum(comm, values[comm.rank :: comm.size]) == exact
    assert ordered_sum(comm, values[::-1][comm.rank :: comm.size]) == exact
    assert ordered_sum(comm, values if comm.rank == comm.size - 1 else values[:0]) == exact


def test_ordered_sum_of_columns(comm):
    values = wild(600).reshape(200, 3)
    found = ordered_sum(comm, np.asfortranarray(values)[comm.rank :: comm.size])
    np.testing.assert_array_equal(found, [math.fsum(column) for column in values.T])


@pytest.mark.parametrize(
    "values, expected",
    [
        ([], 0.0),
        ([-0.0], 0.0),
        ([5e-324, 5e-324, 5e-324], 1.5e-323),
        ([2.2250738585072014e-308, -5e-324], 2.225073858507201e-308),
        ([1.7e308, 1.7e308, -1.7e308, -1.7e308, -2.0], -2.0),
        ([1.7e308, 1.7e308], math.inf),
        ([-1.7e308, -1.7e308], -math.inf),
        ([math.inf, 1.0], math.inf),
        ([-math.inf, 1.0], -math.inf),
        ([math.inf, -math.inf], math.nan),
        ([math.nan, 1.0], math.nan),
        ([1.0, 2.0**-53], 1.0),
        ([1.0, 2.0**-53, 2.0**-1000], 1.0 + 2.0**-52),
    ],
)
def test_ordered_sum_at_the_edges(comm, values, expected):
    found = ordered_sum(comm, np.array(values if comm.rank == 0 else [], dtype=float))
    np.testing.assert_equal(found, expected)
    assert math.copysign(1.0, found) == math.copysign(1.0, expected) or math.isnan(expected)


def test_limbs_hold_many_additions():
    limbs = np.zeros(_LIMBS + 3, np.int64)
    values = np.full(1000, -1.7976931348623157e308)
    for _ in range(3):
        _accumulate(values, limbs)
        _accumulate(-values, limbs)
    _accumulate(np.array([0.125]), limbs)
    assert _rounded(limbs) == 0.125
    assert (limbs[: _LIMBS - 1] >= 0).all() and (limbs[: _LIMBS - 1] < 2**32).all()


def test_wrong_shape_is_named(comm):
    with pytest.raises(ValueError, match="^values: expected shape"):
        ordered_sum(comm, np.zeros((2, 2, 2)))


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
