"""Formulas: what they may say, what they give."""

import pickle

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
        ("-2.5", [-2.5, -2.5]),
    ],
)
def test_values(source, expected):
    np.testing.assert_allclose(Formula(source).evaluate(POINTS), expected, rtol=1e-15, atol=1e-15)


def test_whole_numbers_divide_as_reals():
    assert Formula("1/2").evaluate(POINTS)[0] == 0.5
    assert Formula("X*0 + 1/2 + where(X < 9, 1, 2)/2").evaluate(POINTS)[0] == 1.0


def test_large_whole_numbers_do_not_overflow():
    assert Formula("X*21000000000*21000000000").evaluate(POINTS)[1] == 21e9**2


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


def test_no_points():
    assert Formula("X").evaluate(np.zeros((0, 3))).shape == (0,)
    assert Formula("t").evaluate(np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("X +", "no formula"),
        ("sin(2*X", r"no formula \(one bracket '\(' without '\)'\)"),
        ("X + 1)", r"no formula \(the bracket '\)' at character 6 has no '\(' before it\)"),
        ("X^2", r"'\^' \(a power is '\*\*'\)"),
        ("", "no formula"),
        ("Q + 1", "unknown name 'Q'"),
        ("sn(X)", "unknown function 'sn' \\(did you mean"),
        ("__import__('os').system('true')", "the call"),
        ("X.real", "X.real"),
        ("X[0]", "X\\[0\\]"),
        ("'text'", "'text'"),
        ("lambda: X", "lambda"),
        ("X if Y else Z", "X if Y else Z"),
        ("X < 1 and Y < 1", "write \\(a\\) & \\(b\\)"),
        ("0 < X < 1", "chained comparison"),
        ("sin(X, Y)", "cannot be compiled"),
        ("sin", "cannot be compiled"),
        ("sum(X)", "unknown function 'sum'"),
        ("where(X, Y)", "cannot be compiled"),
        ("1/0", "cannot be compiled"),
        ("True", "True"),
        ("[X for X in Y]", "for"),
        ("(X := 1)", ":="),
        ("1j*X", "1j"),
        # a power that is complex is no real number
        ("(-8)**(1/3)", "its value is not real"),
        ("X*(-8)**0.5", "its value is not real"),
        ("+".join(["X"] * 500), "more than 200 operations"),
        ("-" * 50_000 + "X", "50001 characters where 10000 are the most"),
        ("-" * 9_000 + "X", "no formula|more than 200"),
        ("(" * 300 + "X" + ")" * 300, "no formula"),
        ("X + " + "9" * 5_000, "no formula"),
        ("10**400", "cannot be compiled"),
        ("X + " + "9" * 400, "a number of 400 digits"),
    ],
)
def test_refused(source, why):
    with pytest.raises(ValueError, match=why):
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


def test_pickled_after_use():
    formula = Formula("X**2")
    formula.evaluate(POINTS)
    copy = pickle.loads(pickle.dumps(formula))
    assert copy == formula
    np.testing.assert_array_equal(copy.evaluate(POINTS), formula.evaluate(POINTS))
