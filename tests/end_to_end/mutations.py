"""Random changes of a scene's tables."""

import copy
import random
from collections.abc import Iterator
from typing import Any

VALUES = (0, 1, -1, 2, 7, 0.5, -3.5, 1e-12, 1e12, 1e300, 1e-320, "", "X", "1e308", "nowhere", [], {}, True, "sin(X)/X")
FAILURE, BALL = "bodies.*.material.failure", {"sphere": {"centre": [9, 9, 9], "radius": 1}}

# tables and keys that a scene may have beside its own, by where they are put; "*" is every entry of a list
ADDED: tuple[tuple[str, Any], ...] = (
    ("errors", {"ratios": [0.75, 0.5]}),
    ("errors", {}),
    ("method.substeps", 3),
    ("methods.*.substeps", "auto"),
    ("methods", [{"name": "one", "kind": "mpm", "cell": 0.5}, {"name": "two", "kind": "tlsph"}]),
    ("bodies.*.method", "one"),
    ("bodies.*.name", "block"),
    ("bodies.*.temperature", "300 + X"),
    ("bodies.*.displacement", ["1e-3*X", "0"]),
    ("bodies.*.micro_rate", "1"),
    (FAILURE, {"criteria": [{"kind": "plastic-strain", "limit": 0.2}], "after": "delete"}),
    (FAILURE, {"criteria": [{"kind": "maximum-stress", "strength": 1e9}], "scatter": {"modulus": 5}}),
    ("contact", [{"bodies": ["block"], "friction": 0.2}]),
    ("contact", [{"bodies": ["left", "right"], "stiffness": 10}]),
    ("tie", [{"bodies": ["left", "right"]}]),
    ("tools", [{"name": "floor", "shape": {"plane": {"point": [0, -1], "normal": [0, 1]}}, "friction": 0.1}]),
    ("tools", [{"name": "ball", "shape": BALL, "mass": 1.0, "velocity": [0, 0, 1]}]),
    ("tools", [{"name": "die", "shape": {"mesh": {"file": "none.vtk"}}, "motion": {"velocity": ["sin(t)", "0"]}}]),
)


def grafted(scene: dict, donors: list[dict], chance: random.Random) -> dict:
    """A scene with a table of another one, or with one of `ADDED`, beside or in the place of its own."""
    scene = copy.deepcopy(scene)
    if chance.random() < 0.5:
        donor = chance.choice(donors)
        key = chance.choice([key for key in donor if key not in ("output", "title")])
        table = copy.deepcopy(donor[key])
        both = isinstance(table, list) and isinstance(scene.get(key), list) and chance.random() < 0.5
        scene[key] = scene[key] + table if both else table
        return scene
    path, value = chance.choice(ADDED)
    _put(scene, path.split("."), value)
    return scene


def _put(place: Any, keys: list[str], value: Any) -> None:
    """Put a value where keys lead, as far as there are tables on the way."""
    if keys[0] == "*":
        for entry in place if isinstance(place, list) else ():
            _put(entry, keys[1:], value)
    elif isinstance(place, dict) and len(keys) == 1:
        place[keys[0]] = copy.deepcopy(value)
    elif isinstance(place, dict):
        _put(place.get(keys[0]), keys[1:], value)


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
