"""Formulas: what they may say, what they give."""

import re

import numpy as np
import pytest

from parsolid.scene.formulas import Formula, FormulaVector

POINTS = np.array([[0.25, 2.0, -1.0], [1.0, 3.0, 4.0]])


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("X + Y*Z", [0.25 - 2.0, 13.0]),
        ("where(X < 0.5, 2*X, 1)", [0.5, 1.0]),
        ("where((X < 0.5) & (Y > 1), 1, 0)", [1.0, 0.0]),
        ("where(~(X < 0.5) | (Z == -1), 1, 0)", [1.0, 1.0]),
        ("-X**2", [-0.0625, -1.0]),
        ("sin(pi*X)", [np.sin(0.25 * np.pi), np.sin(np.pi)]),
        ("arctan2(Z, X)", [np.arctan2(-1.0, 0.25), np.arctan2(4.0, 1.0)]),
        ("Y % 2", [0.0, 1.0]),
        (3, [3.0, 3.0]),
        ("X*0 + 1/2 + where(X < 9, 1, 2)/2", [1.0, 1.0]),
        ("X*21000000000*21000000000", [0.25 * 21e9**2, 21e9**2]),
        ("-2.5", [-2.5, -2.5]),
    ],
)
def test_values(source, expected):
    np.testing.assert_allclose(Formula(source).evaluate(POINTS), expected, rtol=1e-15, atol=1e-15)


def test_time_and_constancy():
    formula = Formula("X*t")
    assert formula.depends_on_time and not formula.is_constant
    np.testing.assert_array_equal(formula.evaluate(POINTS, 2.0), 2.0 * POINTS[:, 0])
    assert Formula("exp(-t)").evaluate(POINTS, 1.0).shape == (2,)
    assert Formula("2*pi").is_constant and not Formula("2*pi").depends_on_time


def test_points_with_any_strides():
    spread = np.zeros((3, 4))
    spread[:, :2] = POINTS.T
    np.testing.assert_array_equal(Formula("X - Y").evaluate(spread.T[:2]), POINTS[:, 0] - POINTS[:, 1])
    assert Formula("X").evaluate(np.zeros((0, 3))).shape == Formula("t").evaluate(np.zeros((0, 3))).shape == (0,)


NO_FORMULAS = """X + | sin(2*X | X + 1) | X^2 | Q + 1 | sn(X) | __import__('os').system('true') | X.real | X[0] |
'text' | lambda: X | X if Y else Z | X < 1 and Y < 1 | 0 < X < 1 | sin(X, Y) | sin | sum(X) | where(X, Y) | 1/0 | True |
[X for X in Y] | (X := 1) | 1j*X | (-8)**(1/3) | X*(-8)**0.5 | 10**400"""
LONG = {
    "terms": "+".join(["X"] * 500),
    "signs": "-" * 50_000 + "X",
    "fewer signs": "-" * 9_000 + "X",
    "brackets": "(" * 300 + "X" + ")" * 300,
    "digits": "X + " + "9" * 5_000,
    "fewer digits": "X + " + "9" * 400,
}


@pytest.mark.parametrize("source", ["", *re.split(r" \|\s", NO_FORMULAS), *LONG.values()], ids=lambda text: text[:20])
def test_refused(source):
    with pytest.raises(ValueError, match="."):
        Formula(source)


def test_a_sum_of_many_terms_is_a_formula():
    terms = "+".join(f"sin({i}*X)" for i in range(150))
    expected = sum(np.sin(i * POINTS[:, 0]) for i in range(150))
    np.testing.assert_allclose(Formula(terms).evaluate(POINTS), expected, rtol=0.0, atol=1e-12)


def test_names_can_be_restricted():
    with pytest.raises(ValueError, match="unknown name 't'"):
        Formula("X*t", ("X", "Y"))


def test_vector_with_free_components():
    vector = FormulaVector([Formula("X"), None, Formula("t")])
    np.testing.assert_array_equal(vector.evaluate(POINTS, 5.0), [[0.25, 0.0, 5.0], [1.0, 0.0, 5.0]])
    np.testing.assert_array_equal(vector.free, [False, True, False])
    assert vector.depends_on_time and not vector.is_constant
