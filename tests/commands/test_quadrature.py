"""Errors of nodal accelerations.

the published ones of particles, one-dimensional integrals for exact integration, the command.
"""

import csv
import itertools

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import BSpline
from scipy.optimize import brentq

from parsolid.commands import quadrature
from parsolid.commands.cli import main

# of 2 x 2 particles a cell and 64 cells a side, and of 4 x 4
PUBLISHED = {"linear": 7.78, "ugimp": 1.05, "quadratic-spline": 0.823, "cubic-spline": 0.093, "cpgimp": 0.0110}
PUBLISHED_FINE = {"quadratic-spline": 0.463, "cubic-spline": 0.038}

pytestmark = pytest.mark.serial


def error_of_particles(kind, cells, per_cell):
    solution, time = quadrature.manufactured()
    points = quadrature.particles(solution, time, cells, per_cell, kind == "cpgimp")
    return quadrature.acceleration_error(kind, points, solution, time, cells)


@pytest.mark.parametrize("kind", quadrature.BASES)
def test_particles_have_the_published_errors(kind):
    assert error_of_particles(kind, 64, 2) == pytest.approx(PUBLISHED[kind], rel=0.1)
    if kind in PUBLISHED_FINE:
        assert error_of_particles(kind, 64, 4) == pytest.approx(PUBLISHED_FINE[kind], rel=0.1)


def along_a_side(degree, cells):
    """Errors of the accelerations of the nodes of a side with exact integrals, int N a / F dx / int N / F dx, and the
    exact ones.

    Density and acceleration are products of functions of x and y, so that the integrals are one-dimensional.
    """
    amplitude, frequency = quadrature.AMPLITUDE, quadrature.manufactured()[0].frequency

    def place(x):
        x = abs(x) if x < 1.0 else 2.0 - x
        return brentq(lambda X: X + amplitude * np.sin(np.pi * X) - x, -0.1, 1.1, xtol=1e-15)

    def stretch(x):
        return 1.0 + amplitude * np.pi * np.cos(np.pi * place(x))

    def acceleration(x):
        sign = 1.0 if 0.0 <= x <= 1.0 else -1.0
        return -sign * frequency**2 * amplitude * np.sin(np.pi * place(x))

    spline = BSpline.basis_element(np.arange(degree + 2) - 0.5 * (degree + 1), extrapolate=False)
    errors, exact = [], [acceleration(node / cells) for node in range(cells + 1)]
    for node in range(cells + 1):
        knots = (node + np.arange(degree + 2) - 0.5 * (degree + 1)) / cells
        moments = [
            sum(
                quad(lambda x: spline(x * cells - node) * f(x) / stretch(x), *ends, epsabs=1e-12)[0]
                for ends in itertools.pairwise(knots)
            )
            for f in (acceleration, lambda x: 1.0)
        ]
        errors.append(moments[0] / moments[1] - exact[node])
    return np.array(errors), np.array(exact)


@pytest.mark.parametrize("kind, degree", [("linear", 1), ("quadratic-spline", 2), ("cubic-spline", 3)])
def test_exact_integrals_against_one_dimensional_ones(kind, degree):
    cells = 8
    solution, time = quadrature.manufactured()
    # the motions along both directions are each other's mirror images: the same errors
    errors, exact = along_a_side(degree, cells)
    wanted = np.sqrt((errors**2).mean() / (exact**2).max())
    points = quadrature.gauss_points(solution, time, cells)
    assert quadrature.acceleration_error(kind, points, solution, time, cells) == pytest.approx(wanted, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", quadrature.POINTWISE)
def test_nearly_all_of_the_error_is_quadrature(kind):
    error, exact = quadrature.errors(kind, 64, 2)
    assert exact < 0.04 * error
    # and the rest is of second order
    assert quadrature.errors(kind, 32, 2)[1] / exact == pytest.approx(4.0, rel=0.02)


def test_the_command_writes_its_table(tmp_path, capsys):
    table = tmp_path / "table.csv"
    assert main(["quadrature", "--cells", "8", "--per-cell", "1", "2", "-o", str(table)]) == 0
    assert "cubic-spline" in capsys.readouterr().out
    rows = list(csv.reader(table.open()))
    assert len(rows) == 1 + 2 * len(quadrature.BASES)
    assert float(rows[1][3]) == pytest.approx(error_of_particles("linear", 8, 1), rel=0.01)
