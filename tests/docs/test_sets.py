"""Where every other parameter set of a test runs, each value of each of its parameters has its turn."""

import random
from itertools import product
from types import SimpleNamespace

import pytest
from chessboard import white_fields


def items(**sides):
    """Parameter sets of a function, the first parameter changing last; a name "a, b" is of two that change together."""
    marks = [SimpleNamespace(args=(names,)) for names in sides]
    found = []
    for values in product(*sides.values()):
        params = {}
        for names, value in zip(sides, values):
            parts = names.split(", ")
            params |= dict(zip(parts, value if len(parts) > 1 else (value,)))
        found.append(SimpleNamespace(callspec=SimpleNamespace(params=params), iter_markers=lambda name: iter(marks)))
    return found


@pytest.mark.parametrize(
    "sides",
    [
        {"dimension": [2, 3], "broken": [False, True]},
        {"dimension": [2, 3], "kind": ["a", "b", "c"], "mirror": [False, True]},
        {"law": list("abcde"), "dimension": [2, 3], "size, count": [(2, 7.0), (2, 9.0), (4, 8.0)]},
    ],
)
def test_each_value_is_on_a_black_field_and_half_of_all_are_white(sides):
    sets = items(**sides)
    white = white_fields(sets)
    black = [item for item in sets if item not in white]
    assert 0 <= len(black) - len(white) <= 1
    for name in sets[0].callspec.params:
        values = {item.callspec.params[name] for item in sets}
        assert {item.callspec.params[name] for item in black} == values, name


def test_values_that_change_together_all_run():
    """Also where the first of them is the same."""
    sets = items(**{"state": ["at once", "relaxed"], "clamp, reach": [("mirror", 3), ("layer", 5), ("layer", 10)]})
    black = [item.callspec.params for item in sets if item not in white_fields(sets)]
    assert {one["reach"] for one in black} == {3, 5, 10} and {one["state"] for one in black} == {"at once", "relaxed"}


def test_of_one_parameter_no_value_is_left_out_but_on_several_ranks():
    sets = items(name=list("abcde"))
    assert white_fields(sets) == []
    assert [item.callspec.params["name"] for item in white_fields(sets, each_value=False)] == ["b", "d"]


@pytest.mark.parametrize("seed", range(40))
def test_each_value_runs_on_boards_with_holes(seed):
    """Of sets that were chosen one by one, in any order, as those are whose marks say more of them."""
    draw = random.Random(seed)
    sides = {name: [f"{name}{k}" for k in range(draw.randint(1, 4))] for name in ("law", "dimension", "kind")}
    sets = [item for item in items(**sides) if draw.random() < draw.choice([0.3, 0.6, 0.9])]
    draw.shuffle(sets)
    white = white_fields(sets)
    for name in sides:
        black = {item.callspec.params[name] for item in sets if item not in white}
        assert black == {item.callspec.params[name] for item in sets}, name
