"""Cubic splines beside scipy's."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from parsolid.splines import cubic_spline


@pytest.mark.parametrize("n", [2, 3, 4, 5, 300])
def test_a_spline_is_that_of_scipy_inside_and_outside(n):
    random = np.random.default_rng(n)
    x = np.cumsum(10.0 ** random.uniform(-3.0, 1.0, n))
    y = np.sin(x) + random.normal(size=n)
    at = np.concatenate((x, random.uniform(x[0], x[-1], 200), [x[0] - 0.1, x[-1] + 0.1]))
    wanted = CubicSpline(x, y)(at)
    np.testing.assert_allclose(cubic_spline(x, y, at), wanted, rtol=0.0, atol=1e-11 * np.abs(wanted).max())


def test_a_cubic_is_met_exactly():
    x, at = np.array([0.0, 0.5, 2.0, 2.25, 4.0]), np.linspace(-1.0, 5.0, 25)
    np.testing.assert_allclose(cubic_spline(x, x**3 - 2.0 * x, at), at**3 - 2.0 * at, rtol=1e-12, atol=1e-12)
