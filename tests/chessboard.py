"""Which parameter sets of a test are left out where every other one will do: the white fields of a board.

Its sides are the parameters, so that each value of each of several stays.
"""

from collections import defaultdict


def white_fields(sets: list) -> list:
    """Of the items of one test function, all its parameter sets in their order, the white ones."""
    places, found = defaultdict(dict), []
    for item in sets:
        marks = [mark.args[0] for mark in item.iter_markers("parametrize")]
        together = [names.replace(",", " ").split() if isinstance(names, str) else names for names in marks]
        # of names that change together one is a side
        sides = item.callspec.params.keys() - {name for names in together for name in names[1:]}
        steps = [places[side].setdefault(id(item.callspec.params[side]), len(places[side])) for side in sides]
        if sum(steps) % 2:
            found.append(item)
    return found
