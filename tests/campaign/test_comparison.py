"""Numbers of runs beside published ones: what a study may state of them, how histories give them, and verdicts."""

from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import ValidationError

from parsolid.campaign.comparison import (
    INSIDE,
    MISSING,
    NEAR,
    OUTSIDE,
    UNRESOLVED,
    Comparison,
    Reading,
    Row,
    rows_of_comparison,
)
from parsolid.campaign.records import Record
from parsolid.scene.formulas import number_of

pytestmark = pytest.mark.serial

TIMES = np.linspace(0.0, 4.0, 401)
HISTORY = {
    "time": TIMES,
    "p.u": 3.0 + 2.0 * np.cos(2.0 * np.pi * 0.7 * TIMES),
    "p.x": 5.0 * TIMES,
    "p.y": 2.0 - 15.0 * TIMES,
    "tip.x": np.where(TIMES < 1.0, np.nan, TIMES),
    "flat.u": 0.0 * TIMES,
    # through 0 upwards at .4, 1, 2.1, downwards at .7, 1.9
    "p.z": np.interp(TIMES, [0.3, 0.5, 0.6, 0.8, 0.9, 1.1, 1.8, 2.0, 2.2], [-1, 1, 1, -1, -1, 1, 1, -1, 1]),
}


def comparison(**more):
    stated = {"quantity": "u", "value": 2.0, "source": "someone 1900", "readings": {"u": {"column": "p.u"}}}
    return Comparison.model_validate(stated | more)


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ({"column": "p.x"}, 20.0),
        ({"column": "p.u", "take": "first"}, 5.0),
        ({"column": "p.u", "take": "maximum", "begin": 0.5, "end": 1.0}, 3.0 + 2.0 * np.cos(1.4 * np.pi)),
        ({"column": "p.u", "take": "range"}, 4.0),
        ({"column": "p.u", "take": "frequency"}, 0.7),
        ({"column": "p.z", "take": "frequency"}, 1.0 / (0.5 * (0.85 + 1.2))),
        ({"column": "p.x", "take": "mean", "begin": 1.0, "end": 3.0}, 10.0),
        ({"column": "p.x", "take": "slope"}, 5.0),
        ({"column": "p.y", "take": "slope", "against": "p.x"}, -3.0),
        ({"column": "p.y", "take": "crossing", "level": -7.0}, 0.6),
        ({"column": "p.x", "take": "at", "time": 1.2345}, 6.1725),
        ({"column": "p.u", "take": "time_of_minimum", "end": 1.0}, 1.0 / 1.4),
        ({"column": "p.u", "take": "time_of_maximum", "begin": 1.0, "end": 2.0}, 1.0 / 0.7),
        ({"column": "tip.x", "take": "first"}, 1.0),
    ],
)
def test_a_history_is_read(stated, expected):
    assert Reading.model_validate(stated).value(HISTORY) == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize(
    "stated",
    [
        {"column": "p.v"},
        {"column": "p.x", "begin": 5.0},
        {"column": "p.x", "take": "frequency"},
        {"column": "p.x", "take": "crossing", "level": 30.0},
        {"column": "p.x", "take": "slope", "against": "flat.u"},
    ],
)
def test_a_history_that_does_not_have_it(stated):
    with pytest.raises(ValueError, match=r"\w"):
        Reading.model_validate(stated).value(HISTORY)


def of_u(**more) -> dict:
    return {"readings": {"u": {"column": "p.u"} | more}}


@pytest.mark.parametrize(
    ("table", "place"),
    [
        (of_u(take="crossing"), ("readings", "u", "level")),
        (of_u(level=1.0), ("readings", "u", "level")),
        (of_u(take="at"), ("readings", "u", "time")),
        (of_u(against="p.x"), ("readings", "u", "against")),
        (of_u(begin=2.0, end=1.0), ("readings", "u", "end")),
        (of_u(take="median"), ("readings", "u", "take")),
        ({"readings": {}}, ("readings",)),
        ({"readings": {"a": {"column": "p.u"}, "b": {"column": "p.x"}}}, ("formula",)),
        ({"formula": "2*v"}, ("formula",)),
        ({"formula": "__import__('os')"}, ("formula",)),
        ({"value": 0.0}, ("value",)),
        ({"scatter": 0.1, "tolerance": 0.1}, ("tolerance",)),
        ({"scatter": -0.1}, ("scatter",)),
        ({"sources": "x"}, ("sources",)),
    ],
)
def test_what_makes_no_sense_is_refused_at_its_key(table, place):
    with pytest.raises(ValidationError) as error:
        comparison(**table)
    assert place in [one["loc"] for one in error.value.errors()]


def test_formulas_of_named_numbers():
    assert number_of("-2*sqrt(P)/pi", {"P": 4.0}) == pytest.approx(-4.0 / np.pi)
    assert number_of("arctan2(a, b)", {"a": 1.0, "b": 1.0}) == pytest.approx(np.pi / 4.0)
    assert np.isnan(number_of("log(a)", {"a": -1.0}))
    with pytest.raises(ValueError, match="'c'"):
        number_of("a + c", {"a": 1.0})


@pytest.mark.parametrize(
    ("stated", "computed", "bar", "verdict"),
    [
        ({"value": 2.0}, 2.09, None, NEAR),
        ({"value": -2.0}, -2.11, None, OUTSIDE),
        ({"value": 2.0}, 2.07, 0.08, INSIDE),
        ({"value": 2.0, "tolerance": 0.1}, 2.11, 0.12, INSIDE),
        ({"value": 2.0, "scatter": 0.05}, 2.09, None, OUTSIDE),
        ({"value": 2.0, "scatter": 0.05}, 2.09, 0.05, INSIDE),
        ({"value": 2.0, "scatter": 0.05}, 1.96, None, INSIDE),
        ({"value": 2.0, "tolerance": 0.01}, 2.03, 0.02, OUTSIDE),
        ({"value": 0.0, "tolerance": 0.01}, 0.009, None, NEAR),
        # a bar wider than the tolerance, or than scatter and 5 %, cannot show a disagreement of that size
        ({"value": 2.0}, 2.4, 0.6, UNRESOLVED),
        ({"value": 2.0}, 2.0, 0.11, UNRESOLVED),
        ({"value": 2.0, "tolerance": 0.01}, 2.0, 0.03, UNRESOLVED),
        ({"value": 2.0, "scatter": 0.3}, 2.0, 0.31, UNRESOLVED),
        ({"value": 2.0, "scatter": 0.01}, 2.0, 0.09, INSIDE),
        # but shows one that is larger than itself
        ({"value": 2.0}, 2.8, 0.6, OUTSIDE),
    ],
)
def test_verdicts(stated, computed, bar, verdict):
    assert comparison(**stated).verdict(computed, bar) == verdict


K = {"k": {"column": "kinetic"}}


def case(spacing, value, series="a", status="finished"):
    history = {"time": np.array([0.0, 1.0]), "kinetic": np.array([0.0, value])}
    record = Record(status, history, {"particles": 7, "steps": 3}, [2.0], [1.5], "it broke")
    scene = SimpleNamespace(contact=[], tools=[], systems=[], bodies=[], boundaries=[], probes=[])
    scene.systems = [SimpleNamespace(settings=SimpleNamespace(kind="tlsph"))]
    more = {"labels": {"h": str(spacing)}, "resolution_axis": "h", "line": (series,), "title": f"{series}, {spacing}"}
    return SimpleNamespace(series=SimpleNamespace(name=series), record=record, spacing=spacing, scene=scene, **more)


def test_the_bar_is_that_of_the_resolutions():
    """1 + 0.4 h^2 at h = 1, 1/2, 1/4: the limit is 1, the order 2, the bar 1.25 times the error of the finest."""
    line = [case(h, 1.0 + 0.4 * h * h) for h in (1.0, 0.5, 0.25)]
    stated = comparison(value=1.0, readings=K)
    (row,) = rows_of_comparison("t", stated, [line])
    assert row.order == pytest.approx(2.0, abs=0.01)
    assert row.bar == pytest.approx(1.25 * 0.025, rel=0.02)
    assert row.error == pytest.approx(0.025) and row.verdict == INSIDE
    assert [one.value for one in row.levels] == pytest.approx([1.4, 1.1, 1.025])
    assert row.core_seconds == 2.0
    assert row.errors() == [(1.5, pytest.approx(error)) for error in (0.4, 0.1, 0.025)]
    # two resolutions: no order is observed, the known one and the factor 3
    (row,) = rows_of_comparison("t", stated, [line[1:]])
    assert row.order is None and row.bar == pytest.approx(3.0 * 0.025)
    assert rows_of_comparison("t", stated, [line[2:]])[0].bar is None


def test_what_is_not_resolved_is_told_and_no_fault():
    line = [case(h, 1.0 + 0.4 * h) for h in (1.0, 0.5, 0.25)]
    (row,) = rows_of_comparison("t", comparison(value=1.0, readings=K), [line])
    assert (row.verdict, row.agrees, row.faulty) == (UNRESOLVED, False, False) and row.reason


def test_runs_without_the_number_are_told_and_a_stated_cause_is_no_excuse():
    for more in ({}, {"cause": "known"}):
        (row,) = rows_of_comparison("t", comparison(**more), [[case(1.0, 2.0)]])
        assert (row.verdict, row.computed, row.agrees, row.faulty) == (MISSING, None, False, True) and row.reason
    (failed,) = rows_of_comparison("t", comparison(readings=K), [[case(1.0, 2.0, status="failed")]])
    assert failed.verdict == MISSING and "it broke" in failed.reason


def test_rows_are_of_the_series_that_compute_it_and_are_read_back():
    lines = [[case(1.0, 2.0, "a")], [case(1.0, 2.0, "b")]]
    (row,) = rows_of_comparison("t", comparison(series=["b"], readings=K), lines)
    assert row.method == "b" and Row.of(asdict(row)) == row
