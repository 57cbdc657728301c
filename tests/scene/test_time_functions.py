"""Functions of time and place of formulas: values, rates, the times at which they turn, messages."""

import numpy as np
import pytest
from solids import simulation, tables

from parsolid.scene import SceneError, dump_scene, load_scene, parse_scene
from parsolid.scene.formula_terms import _RATES
from parsolid.scene.formulas import Formula, FormulaVector
from parsolid.scene.load_histories import LoadHistory, Timed
from parsolid.simulation.scene_changes import contents

POINTS = np.array([[0.25, 2.0, -1.0], [1.0, 3.0, 4.0]])


@pytest.fixture
def folder(tmp_path):
    """A folder with a table of a force and a stroke."""
    (tmp_path / "pull.csv").write_text("time,force,stroke\n0,0,1\n1,2,1\n1,4,1\n3,0,7\n", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize(
    ("source", "time", "expected"),
    [
        ("min(t/0.02, 1)", 0.01, [0.5, 0.5]),
        ("min(X, Y, Z)", 0.0, [-1.0, 1.0]),
        ("max(X, 0.5, t)", 0.75, [0.75, 1.0]),
        ("clip(X + Y, 0, 3)", 0.0, [2.25, 3.0]),
        ("5*ramp(t, 1e-3, 2e-3)*X", 1.5e-3, [0.625, 2.5]),
        ("ramp(t, 1, 2)", 0.5, [0.0, 0.0]),
        ("step(t, 0.1) - step(t, 0.2)", 0.1, [1.0, 1.0]),
        ("step(X, 0.5)", 0.0, [0.0, 1.0]),
        ('table("pull.csv")', 2.0, [2.0, 2.0]),
        ("table('pull.csv', t, 'stroke')*X", 9.0, [1.75, 7.0]),
        ('table("pull.csv", 2*X)', 0.0, [1.0, 2.0]),
    ],
)
def test_values(folder, source, time, expected):
    np.testing.assert_allclose(Formula(source, folder=str(folder)).evaluate(POINTS, time), expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("source", "pointwise"),
    [
        ("0.1*sin(5*t)*(1 + Y) - X*t/2 + Z", [False, False]),
        ("(X - t)*(X + t)/(1 + t)", [True]),
        ("(1 + Y)/(2 + t) + (X + t)/Y", [False, False]),
        ("3/(X + 1) + t**2", [False]),
        ("X*cos(t - Y)", [True]),
        # of what is true or false, sums are no sums of numbers
        ("(t < 1)*(X < 0.5) + (t < 2)*(Y > 0)", [True]),
        ("(X < 0.5) - (2 < t)*X", [True]),
    ],
)
def test_values_are_sums_of_factors_in_time_times_modes(source, pointwise):
    formula = Formula(source)
    load = LoadHistory(FormulaVector((formula, None)), Timed(history={"rows": [[0.0, 2.0], [1.0, 3.0]]}))
    plain = LoadHistory(FormulaVector((formula,))).separated(POINTS)
    assert plain.pointwise == pointwise
    for time in (0.0, 0.3, 0.9, 2.0):
        expected = formula.evaluate(POINTS, time)
        np.testing.assert_allclose(plain.values(time, False)[0] + np.zeros(2), expected, rtol=1e-13)
        values = load.evaluate(POINTS, time)
        np.testing.assert_allclose(values[:, 0], (2.0 + min(time, 1.0)) * expected, rtol=1e-13)
        assert not values[:, 1].any()


@pytest.mark.parametrize(
    ("source", "jumps", "corners"),
    [
        ("min(t/0.02, 1)", (), (0.02,)),
        ("ramp(t, 0.001, 0.002)*sin(t)", (), (0.001, 0.002)),
        ("X*step(t, 0.3)", (0.3,), (0.3,)),
        ("clip(2*t - 1, 0, 1)", (), (0.5, 1.0)),
        ('table("pull.csv", t/10)', (10.0,), (0.0, 10.0, 30.0)),
        # of place, or not linear: no time is known
        ("ramp(t - X, 0, 1) + min(t**2, 1) + step(X, 1)", (), ()),
        ("where(t < 0.5, 1, 0)", (), ()),
    ],
)
def test_times_at_which_a_formula_turns(folder, source, jumps, corners):
    formula = Formula(source, folder=str(folder))
    assert (formula.jumps, formula.corners) == (pytest.approx(jumps), pytest.approx(corners))


@pytest.mark.parametrize(
    "source",
    [
        "sin(3*t)**2*X",
        "0.3*ramp(t, 0.1, 0.6)",
        "min(t/0.02, 1)*exp(-t)",
        "where(X < 0.5, t**3, cos(t)*Y)",
        "clip(t, 0.1, 0.5)*max(t, X)",
        "table('pull.csv', 2*t)*t",
        "sqrt(1 + t)/(2 + t)",
        "(1 + t)**(2*t)",
        "arctan(t)*log(1 + t) - tanh(-t)",
        "abs(t - 3)*X",
    ],
)
def test_rates_are_those_of_differences(folder, source):
    formula, h = Formula(source, folder=str(folder)), 1e-6
    for time in (0.015, 0.33, 0.7):
        change = formula.evaluate(POINTS, time + h) - formula.evaluate(POINTS, time - h)
        np.testing.assert_allclose(formula.rate().evaluate(POINTS, time), change / (2 * h), atol=1e-7)
    # at a corner, the one after it
    rate = Formula("ramp(t, 1, 2)").rate()
    assert [rate.evaluate(POINTS, time)[0] for time in (0.5, 1.0, 1.5, 2.0)] == [0.0, 1.0, 1.0, 0.0]


@pytest.mark.parametrize("name", sorted(_RATES))
def test_the_slope_of_every_function_is_that_of_differences(name):
    formula, h = Formula(f"{name}({1.5 if name == 'arccosh' else 0.2} + 0.5*t)"), 1e-6
    change = formula.evaluate(POINTS, 0.4 + h) - formula.evaluate(POINTS, 0.4 - h)
    np.testing.assert_allclose(formula.rate().evaluate(POINTS, 0.4), change / (2.0 * h), rtol=1e-7)


REFUSED = ["min(t)", "ramp(t, 0)", "table(t)", 'table("none.csv")', 'table("pull.csv", t, "length")']


@pytest.mark.parametrize("source", [*REFUSED, 'table("pull.csv", Q)', "'pull.csv' + t", "mn(t, 1)"])
def test_refused(folder, source):
    with pytest.raises(ValueError, match="."):
        Formula(source, folder=str(folder))


def test_a_scene_with_a_table_is_written_read_and_compared(folder, square):
    square["loads"] = {"acceleration": ['table("pull.csv")', "0"]}
    scene = parse_scene(square, folder)
    dump_scene(scene, folder / "away" if (folder / "away").mkdir() else folder / "away" / "scene.toml")
    assert load_scene(folder / "away" / "scene.toml").resolved()["loads"] == scene.resolved()["loads"]
    before = contents(scene)
    (folder / "pull.csv").write_text("time,force\n0,1\n", encoding="utf-8")
    assert contents(scene) != before and str(folder) not in str(before["loads"])
    (folder / "pull.csv").write_text("time,force\n1,1\n0,2\n", encoding="utf-8")
    with pytest.raises(SceneError, match="loads.acceleration.0: expected "):
        parse_scene(square, folder)


@pytest.mark.parametrize("integrator", ["ssp-rk3", "leapfrog"])
def test_steps_end_where_a_load_jumps(integrator):
    """A force that acts for a time gives exactly its impulse."""
    data = tables((5, 5), end_time=0.2, method={"integrator": integrator})
    data["loads"] = {"acceleration": ["step(t, 0.05) - step(t, 0.0912345)", "2*ramp(t, 0.03, 0.13)"]}
    sim = simulation(data)
    while sim.clock.time < 0.2:
        sim.stable = sim.systems[0].stable_step()
        step, arrival = sim.time_steps.next(sim.clock.time, sim.stable)
        sim.take_step(step)
        sim.clock.time = arrival
    velocity = sim.systems[0].particles.owned_rows("velocity")
    np.testing.assert_allclose(velocity, np.tile([0.0412345, 0.1 + 0.14], (25, 1)), rtol=1e-11)
