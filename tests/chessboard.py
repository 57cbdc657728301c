"""Which parameter sets of a test are left out where every other one will do: the white fields of a board.

Its sides are the parameters.
"""

from collections import defaultdict


def white_fields(sets: list, each_value: bool = True) -> list:
    """Of the items of one test function, all its parameter sets in their order, the white ones.

    each_value: a field whose white would leave a value of a parameter without any black one stays black, so that each
    value of each parameter runs; of one parameter alone no set is left out.
    """
    places, found = defaultdict(dict), []
    white = [_steps(item, places) % 2 == 1 for item in sets]
    values = [{(name, id(value)) for name, value in item.callspec.params.items()} for item in sets]
    black = set().union(*(own for own, left in zip(values, white) if not left))
    for item, own, left in zip(sets, values, white):
        if left and not (each_value and own - black):
            found.append(item)
        elif left:
            black |= own
    return found


def _steps(item, places) -> int:
    """How many steps along all sides an item is from the first."""
    marks = [mark.args[0] for mark in item.iter_markers("parametrize")]
    together = [names.replace(",", " ").split() if isinstance(names, str) else names for names in marks]
    # of names that change together one is a side
    sides = item.callspec.params.keys() - {name for names in together for name in names[1:]}
    return sum(places[side].setdefault(id(item.callspec.params[side]), len(places[side])) for side in sides)
