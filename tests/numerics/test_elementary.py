"""Elementary functions on four lanes against the C library's."""

import math

import numpy as np
import pytest

from decomposition.compiled import compiled
from parsolid.numerics.elementary import choose, power, some_positive
from parsolid.numerics.lanes import load, store


@compiled
def functions(x, result):
    for i in range(0, x.shape[1], 4):
        v = load(x, 0, i)
        store(result, 0, i, math.exp(v))
        store(result, 1, i, math.log(v))
        store(result, 2, i, math.erf(v))
        store(result, 3, i, power(v, 0.31))


@compiled
def choices(x, result):
    v = load(x, 0, 0)
    store(result, 0, 0, choose(v, v, -1.0))
    store(result, 1, 0, choose(v - 100.0, 1.0, v))
    return some_positive(v), some_positive(v - 100.0), choose(2.0, 3.0, 4.0), choose(math.nan, 3.0, 4.0)


def test_functions_are_within_rounding():
    random = np.random.default_rng(5)
    wide, near_one = 10.0 ** random.uniform(-300, 2.8, 4000), 1.0 + random.uniform(-1e-3, 1e-3, 4000)
    x = np.concatenate([wide, near_one, [1.0, 2.0, 0.5, 700.0]])[None, :]
    result = np.empty((4, x.shape[1]))
    functions(x, result)
    exact = np.log(x[0])
    # the logarithm keeps its digits next to 1
    np.testing.assert_allclose(result[1], exact, rtol=4e-16, atol=0)
    np.testing.assert_allclose(result[0], np.exp(x[0]), rtol=5e-16)
    np.testing.assert_allclose(result[3], x[0] ** 0.31, rtol=2e-13)
    np.testing.assert_array_equal(result[2], [math.erf(v) for v in x[0]])
    x = -(10.0 ** random.uniform(-20, 2.8, 4000))[None, :]
    result = np.empty((4, x.shape[1]))
    functions(x, result)
    np.testing.assert_allclose(result[0], np.exp(x[0]), rtol=5e-16)


def test_extremes_stay_finite():
    x, result = np.array([[1e4, -1e4, 0.0, -1.0]]), np.empty((4, 4))
    functions(x, result)
    assert result[0, 0] == pytest.approx(math.exp(709.0)) and result[0, 1] == pytest.approx(math.exp(-708.0))
    assert np.isfinite(result).all() and (result[3, 2:] < 1e-90).all()


def test_choices():
    x, result = np.array([[1.0, -2.0, 0.0, np.nan]]), np.empty((2, 4))
    assert choices(x, result) == (True, False, 3.0, 4.0)
    np.testing.assert_array_equal(result[0], [1.0, -1.0, -1.0, -1.0])
    np.testing.assert_array_equal(result[1], x[0])
