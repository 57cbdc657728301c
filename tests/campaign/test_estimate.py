"""What differences between resolutions say: orders and errors that are known, series that swing, those of no order."""

import itertools
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from parsolid.campaign.error_bars import on_times
from parsolid.campaign.estimate import (
    SAFETY,
    SAFETY_DIVERGED,
    SAFETY_NO_ORDER,
    Series,
    crossings,
    largest_nearby,
    observed_order,
    phase_and_amplitude,
    spacing_bar,
)
from parsolid.campaign.orders import order_in_spacing, order_in_time, without_order
from parsolid.campaign.recovery import COLUMN, recovery_bars
from parsolid.campaign.targets import steps_power
from parsolid.scene import load_scene

TIMES = np.linspace(0.0, 1.0, 201)
RATIOS = np.array([1.0, 1.5, 2.25])


def series(error, exact=None):
    """exact(t) + error(h, t) for h of all ratios."""
    exact = np.sin(5.0 * TIMES) if exact is None else exact
    return Series(TIMES, np.array([exact + error(h, TIMES) for h in RATIOS]), RATIOS), exact


@pytest.mark.parametrize("order", [1.0, 1.7, 2.0])
def test_a_power_of_the_spacing_is_found_with_its_error(order):
    found, exact = series(lambda h, t: 0.01 * t * h**order)
    bar = spacing_bar(found, 2.0, 1.0)
    assert bar.order == pytest.approx(order, abs=0.01) and bar.factor == SAFETY
    true = np.abs(found.values[0] - exact)
    assert (bar.error >= true).all() and bar.error[-1] == pytest.approx(SAFETY * true[-1], rel=0.02)


def test_an_order_that_the_method_has_not_is_not_believed():
    found, exact = series(lambda h, t: 0.001 * t * h**5)
    bar = spacing_bar(found, 2.0, 1.0)
    assert bar.used == 2.0 and bar.error[-1] > 5.0 * abs(found.values[0] - exact)[-1]


def test_differences_that_change_sign_or_have_no_order_get_the_large_factors():
    signs = dict(zip(RATIOS, (1.0, -1.0, 1.0)))
    found, exact = series(lambda h, t: 0.01 * signs[h] * t * h)
    bar = spacing_bar(found, 2.0, 1.0)
    assert bar.factor == SAFETY_NO_ORDER and (bar.error >= np.abs(found.values[0] - exact)).all()
    bar = spacing_bar(series(lambda h, t: 0.01 * t * h)[0], 0.0, 1.0)
    assert bar.factor == SAFETY_DIVERGED == 2.0 * SAFETY_NO_ORDER and bar.used == pytest.approx(1.0, abs=0.01)
    assert spacing_bar(series(lambda h, t: 0.0 * t)[0], 0.0, 1.0).used > 0.0


@pytest.mark.parametrize("changes, lost", [(["method.basis=linear"], True), ([], False)])
def test_the_linear_basis_is_known_to_have_none_where_particles_cross_cells(changes, lost):
    scene = load_scene(Path(__file__).parents[2] / "runs" / "mpm" / "axis_aligned.toml", changes)
    assert (order_in_spacing("kinetic", scene) == 0.0) == lost == bool(without_order(scene))


@pytest.mark.parametrize(
    "scene, changes, order",
    [
        ("mpm/axis_aligned", [], 1.0),
        ("tlsph/bending", ["method.integrator=ssp-rk3"], 3.0),
        ("tlsph/bending", ["method.integrator=leapfrog"], 2.0),
        ("peridynamics/vibrating_bar", [], 2.0),
    ],
)
def test_orders_in_the_time_step(scene, changes, order):
    assert order_in_time(load_scene(Path(__file__).parents[2] / "runs" / f"{scene}.toml", changes)) == order


def test_zeros_of_a_swinging_error_are_no_zeros_of_the_bar():
    found, exact = series(lambda h, t: 0.01 * h**2 * np.sin(80.0 * t))
    bar = spacing_bar(found, 2.0, 1.0)
    assert (bar.error >= 0.999 * 0.01 * np.abs(np.sin(80.0 * TIMES))).all() and bar.error[20:].min() > 0.008


def test_a_column_that_does_not_change_in_time_has_the_bar_of_its_differences():
    """Resolutions that differ by 10 % are not exact to rounding, however still they are."""
    found, exact = series(lambda h, t: 0.05 * h**2 + 0.0 * t, exact=np.ones(201))
    bar = spacing_bar(found, 2.0, 1.0)
    assert bar.order == pytest.approx(2.0, abs=0.01) and bar.factor == SAFETY
    assert bar.error == pytest.approx(np.full(201, 1.25 * 0.05), rel=0.02)
    still, _ = series(lambda h, t: 0.0 * t, exact=np.ones(201))
    assert spacing_bar(still, 2.0, 1.0).error.max() < 1e-12


@pytest.mark.parametrize("end", [5.0, 2.0 * np.pi, 7.0, 9.0])
def test_the_window_of_the_end_is_as_wide_as_elsewhere(end):
    """An error that swings through zero at the end: the bar is that of its largest within half a swing."""
    own = lambda h, t: 0.01 * h**2 * np.sin(2.0 * end * (1.0 - t))  # noqa: E731
    found, _ = series(own, exact=np.sin(2.0 * end * TIMES))
    assert found.values[0][-1] == np.sin(2.0 * end)
    bar = spacing_bar(found, 2.0, 1.0)
    assert bar.error[-1] > 0.0099 and largest_nearby(1.0 - TIMES, TIMES, 0.1)[-1] == pytest.approx(0.2)


def test_the_window_does_not_depend_on_the_unit_of_time():
    grows = np.sin(17.0 * TIMES) * TIMES
    for values, unit in itertools.product((grows, grows[::-1]), (1.0, 1e-5)):
        found = largest_nearby(values, unit * TIMES, 0.1025 * unit)
        np.testing.assert_array_equal(found, largest_nearby(values, TIMES, 0.1025))
        wanted = [np.abs(values[np.abs(TIMES - t) < 0.1025]).max() for t in TIMES[21:-21]]
        np.testing.assert_array_equal(found[21:-21], wanted)


def test_ripples_do_not_cross_the_mean():
    swing = np.sin(2.0 * np.pi * TIMES + 0.3)
    assert crossings(swing) == crossings(7.0 + swing + 0.08 * np.cos(2.0 * np.pi * 60.0 * TIMES)) == 2
    assert crossings(np.zeros(9)) == 0


def test_rows_before_a_jump_are_compared_with_rows_before_it():
    other = {"time": np.array([0.0, 0.0, 1.0, 2.0, 2.0, 3.0]), "u": np.array([0.0, 5.0, 6.0, 7.0, 1.0, 0.0])}
    times = np.array([0.0, 0.0, 0.5, 2.0, 2.0, 3.0])
    found = on_times(other, "u", times)
    assert found[[0, 1, 3, 4, 5]] == pytest.approx([0.0, 5.0, 7.0, 1.0, 0.0])


def test_steps_of_waves_and_of_conduction_grow_as_they_did():
    assert steps_power([2.0, 1.0], [100, 200]) == pytest.approx(1.0)
    assert steps_power([4.0, 2.0, 1.0], [10, 40, 160]) == pytest.approx(2.0)
    assert steps_power([2.0, 1.0], [50, 50]) == pytest.approx(0.0, abs=1e-12) and steps_power([1.5], [7]) == 1.0


def test_a_lag_and_a_loss_are_told_apart():
    values = np.array([(1.0 - 0.01 * h**2) * np.sin(20.0 * TIMES * (1.0 - 0.004 * h**2)) for h in RATIOS])
    phase, amplitude = phase_and_amplitude(Series(TIMES, values, RATIOS), 2.0)
    assert phase == pytest.approx(0.004, rel=0.2) and amplitude == pytest.approx(0.01, rel=0.2)
    assert phase_and_amplitude(Series(TIMES, np.array([TIMES, TIMES]), RATIOS[:2]), 2.0) == (None, None)


def test_orders_from_norms_of_differences():
    for order in (0.5, 1.0, 2.0, 3.0):
        second, third = RATIOS[1] ** order, RATIOS[2] ** order
        assert observed_order(second - 1.0, third - second, RATIOS) == pytest.approx(order, abs=0.01)
    assert observed_order(0.0, 1.0, RATIOS) is None


def test_bars_by_recovery_are_those_of_the_manual():
    probes, others = [SimpleNamespace(name="p", quantity=None)], ("systems", "boundaries", "contact", "tools", "bodies")
    scene = SimpleNamespace(probes=probes, tie=[], **{name: [] for name in others})
    names = ["strain_energy", "hold.force_x", "p.nodal_stress_xx", "p.stress_xx", "p.displacement_x", COLUMN]
    values = dict(zip(names, ([0.0, 2.0], [0.0, -5.0], [0.0, 7.0], [0.0, 7.0], [0.0, 1.0], [0.0, 0.02])))
    bars = recovery_bars(scene, np.array([0.0, 1.0]), {name: np.array(one) for name, one in values.items()})
    expected = dict(zip(names, (1.1 * 0.01 * 2.0, 1.1 * 0.01 * 5.0, 0.6 * 0.1 * 7.0)))
    assert {name: bar.error[-1] for name, bar in bars.items()} == pytest.approx(expected, rel=1e-12)
