"""Random changes of a scene's tables."""

import copy
import random
from collections.abc import Iterator
from typing import Any

VALUES = (0, 1, -1, 2, 7, 0.5, -3.5, 1e-12, 1e12, 1e300, 1e-320, "", "X", "1e308", "nowhere", [], {}, True, "sin(X)/X")


def leaves(value: Any, place: tuple = ()) -> Iterator[tuple]:
    """Places of all values within tables and lists."""
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in entries:
        yield (*place, key)
        yield from leaves(part, (*place, key))


def mutated(scene: dict, chance: random.Random, spared: tuple[str, ...] = ("output",)) -> dict:
    """One to three places of a scene with another value, scaled, doubled, or without one; not in tables spared."""
    scene = copy.deepcopy(scene)
    for _ in range(chance.randint(1, 3)):
        *path, last = chance.choice([place for place in leaves(scene) if place[0] not in spared])
        place = scene
        for key in path:
            place = place[key]
        old, way = place[last], chance.random()
        if way < 0.4 and isinstance(old, int | float) and not isinstance(old, bool):
            place[last] = type(old)(old * chance.choice((0.5, 2, 3, -1)))
        elif way < 0.5 and isinstance(old, list):
            place[last] = old + old
        elif way < 0.65:
            del place[last]
        else:
            place[last] = copy.deepcopy(chance.choice(VALUES))
    return scene
