"""Smoothing kernels: shape, derivative and normalisation, from W written down anew."""

import numpy as np
import pytest
from scipy.integrate import quad

from parsolid.pairs.smoothing import kernel_names, smoothing_kernel
from parsolid.pairs.smoothing.gradient import gradient_factor as factor

KERNELS = {name: smoothing_kernel(name) for name in kernel_names()}


def _wendland(q):
    return (1.0 - 0.5 * q) ** 4 * (2.0 * q + 1.0) * (q < 2.0)


def _cubic(q):
    return np.where(q < 1.0, 1.0 - 1.5 * q**2 + 0.75 * q**3, 0.25 * np.maximum(2.0 - q, 0.0) ** 3)


def _quintic(q):
    return sum(factor * np.maximum(end - q, 0.0) ** 5 for end, factor in ((3.0, 1.0), (2.0, -6.0), (1.0, 15.0)))


SHAPES = {"wendland-c2": _wendland, "cubic-spline": _cubic, "quintic-spline": _quintic}


def normalisation(name: str, dimension: int) -> float:
    """c such that the integral of c f(q) over the plane or space is one."""
    area = {2: lambda q: 2.0 * np.pi * q, 3: lambda q: 4.0 * np.pi * q * q}[dimension]
    support = KERNELS[name].support
    integral, _ = quad(lambda q: SHAPES[name](q) * area(q), 0.0, support, points=[1.0, 2.0], epsabs=1e-13, epsrel=1e-13)
    return 1.0 / integral


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", KERNELS)
def test_the_factor_is_the_derivative_of_the_normalised_kernel(name, dimension):
    c, step = normalisation(name, dimension), 1e-5
    for q in np.linspace(0.05, KERNELS[name].support - 0.05, 40):
        derivative = c * (SHAPES[name](q + step) - SHAPES[name](q - step)) / (2.0 * step)
        assert factor(KERNELS[name], q, dimension) * q == pytest.approx(derivative, abs=1e-8 * c * SHAPES[name](0.0))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", KERNELS)
def test_the_integral_from_the_factor_alone_is_one(name, dimension):
    # by parts, with W = 0 on the support's edge: integral of W = -1/d integral of r W'(r)
    sphere = {2: 2.0 * np.pi, 3: 4.0 * np.pi}[dimension]

    def integrand(q):
        return -sphere / dimension * q ** (dimension + 1) * factor(KERNELS[name], q, dimension)

    integral, _ = quad(integrand, 0.0, KERNELS[name].support, points=[1.0, 2.0], epsabs=1e-13, epsrel=1e-13)
    assert integral == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("name", KERNELS)
def test_the_factor_vanishes_outside_and_is_negative_inside(name, dimension):
    support = KERNELS[name].support
    assert all(factor(KERNELS[name], q, dimension) == 0.0 for q in (support, support + 1e-9, 10.0))
    assert all(factor(KERNELS[name], q, dimension) < 0.0 for q in np.linspace(0.01, support - 0.01, 50))
    assert np.isfinite(factor(KERNELS[name], 0.0, dimension))
