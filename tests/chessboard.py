"""Which parameter sets of a test are left out where every other one will do: the white fields of a board.

Its sides are the parameters.
"""

from collections import Counter, defaultdict


def white_fields(sets: list, each_value: bool = True) -> list:
    """Of the items of one test function, all its parameter sets in their order, the white ones.

    each_value: a field whose white would leave a value of a side without any black one stays black, so that each value
    of each parameter runs; of one parameter alone no set is left out.
    """
    places, found = defaultdict(dict), []
    fields = [_field(item, places) for item in sets]
    white = [sum(field.values()) % 2 == 1 for field in fields]
    black = Counter(place for field, left in zip(fields, white) if not left for place in field.items())
    for item, field, left in zip(sets, fields, white):
        if left and not (each_value and 0 in [black[place] for place in field.items()]):
            found.append(item)
        elif left:
            black.update(field.items())
    return found


def _field(item, places) -> dict[str, int]:
    """Where an item stands along each side: the number of its value, in the order in which they appear."""
    marks = [mark.args[0] for mark in item.iter_markers("parametrize")]
    together = [names.replace(",", " ").split() if isinstance(names, str) else names for names in marks]
    # of names that change together one is a side
    sides = item.callspec.params.keys() - {name for names in together for name in names[1:]}
    return {side: places[side].setdefault(id(item.callspec.params[side]), len(places[side])) for side in sides}
