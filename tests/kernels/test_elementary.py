"""exp, log, powers and erf of kernels against those of numpy and math."""

import math

import numpy as np
import pytest

from parsolid.elementary import erf, exp, log, power
from parsolid.kernels import kernel


@kernel
def functions(x, result):
    for i in range(x.size):
        result[0, i] = exp(x[i])
        result[1, i] = log(max(x[i], 1e-300))
        result[2, i] = erf(x[i])
        result[3, i] = power(max(x[i], 0.0), 0.31)


def found(x):
    result = np.empty((4, len(x)))
    functions(np.asarray(x, float), result)
    return result


def test_functions_are_within_rounding():
    random = np.random.default_rng(5)
    wide, near_one = 10.0 ** random.uniform(-300, 2.8, 4000), 1.0 + random.uniform(-1e-3, 1e-3, 4000)
    x = np.concatenate([wide, near_one, [1.0, 2.0, 0.5, 700.0]])
    result = found(x)
    # the logarithm keeps its digits next to 1
    np.testing.assert_allclose(result[1], np.log(x), rtol=7e-16, atol=0)
    np.testing.assert_allclose(result[0], np.exp(x), rtol=7e-16)
    # a polynomial, see `parsolid.elementary.erf`
    np.testing.assert_allclose(result[2], [math.erf(v) for v in x], rtol=0, atol=3e-15)
    np.testing.assert_allclose(result[3], x**0.31, rtol=2e-13)
    x = -(10.0 ** random.uniform(-20, 2.8, 4000))
    np.testing.assert_allclose(found(x)[0], np.exp(x), rtol=7e-16)


def test_extremes_stay_finite():
    result = found([1e4, -1e4, 0.0, -1.0])
    assert result[0, 0] == pytest.approx(math.exp(709.0)) and result[0, 1] == pytest.approx(math.exp(-708.0))
    assert np.isfinite(result).all() and (result[3, 2:] < 1e-90).all()


def test_plain_python_gives_the_same():
    x = [-3.0, 0.25, 1.0, 7.5]
    result = found(x)
    np.testing.assert_allclose(result[0], [exp(v) for v in x], rtol=1e-15)
    np.testing.assert_allclose(result[1, 1:], [log(v) for v in x[1:]], rtol=1e-15)
    np.testing.assert_allclose(result[3, 1:], [power(v, 0.31) for v in x[1:]], rtol=1e-14)
