"""Where every other parameter set of a test runs, each value of each of its parameters has its turn."""

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


def test_of_one_parameter_it_is_every_other_value():
    names = list("abcde")
    assert [item.callspec.params["name"] for item in white_fields(items(name=names))] == ["b", "d"]
