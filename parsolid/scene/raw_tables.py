"""Raw tables of a TOML file: reading, overriding keys, and faults that are independent of the key."""

import re
import tomllib
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Any

import tomli_w

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import LEAST, MOST, Detail
from parsolid.scene.validation_errors import Fault, SceneError, describe, fault, key_path, suggestion

# largest depth of nested tables and lists; a scene has at most eight
DEEPEST = 32

# kind of file -> a table that it must have, and its command
_MARKS = {"scene": "bodies", "study": "series", "material point": "path"}
_COMMANDS = {"scene": "run", "study": "study", "material point": "point"}

# numbers like "1." and ".5", which are not TOML
_SHORT_NUMBER = re.compile(r"[+-]?(\d+\.|\.\d+)([eE][+-]?\d+)?")


def read_tables(path: Path, what: str) -> dict[str, Any]:
    """The raw tables of a TOML file; what: "scene", "study" or "material point". Raises SceneError."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError([f"{path}: expected a readable {what}, found {error.strerror or error}"]) from None
    except ValueError as error:
        raise SceneError([f"{path}: expected TOML, found a fault: {error}"]) from None
    except RecursionError:
        raise SceneError([f"{path}: expected TOML, found tables or lists nested too deeply"]) from None
    if faults := raw_faults(data):
        raise SceneError(faults)
    if _MARKS[what] not in data:
        for name, mark in _MARKS.items():
            if mark in data:
                raise SceneError([f"{path}: expected a {what}, found a {name}: parsolid {_COMMANDS[name]} {path}"])
    return data


def _values(data: dict[str, Any]) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Location and value of everything but tables and lists, and of tables and lists that are nested too deeply."""
    waiting: list[tuple[tuple[Any, ...], Any]] = [((), data)]
    while waiting:
        place, value = waiting.pop()
        if len(place) > DEEPEST:
            yield place, value
        elif isinstance(value, dict):
            waiting += [((*place, key), part) for key, part in value.items()]
        elif isinstance(value, list):
            waiting += [((*place, number), part) for number, part in enumerate(value)]
        else:
            yield place, value


def raw_faults(data: dict[str, Any]) -> list[Fault]:
    """Faults that are independent of the key: deep nesting, integers beyond 64 bits, texts with NUL."""
    faults: list[Fault] = []
    for place, value in _values(data):
        if len(place) > DEEPEST:
            faults.append(fault(place[:3], f"at most {DEEPEST} tables or lists one within the other", Phrase("more")))
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            faults.append(fault(place, "a whole number of 64 bits, as TOML has them", Phrase("a larger one")))
        elif isinstance(value, str) and "\0" in value:
            faults.append(fault(place, "a text without NUL", value))
    return list(dict.fromkeys(faults))


def numbers_out_of_range(data: dict[str, Any]) -> list[Detail]:
    """Faults of numbers that are too large or too small to compute with."""
    return [
        (place, f"0 or a number of a size from {LEAST:g} to {MOST:g}", value)
        for place, value in _values(data)
        if isinstance(value, float) and isfinite(value) and value and not LEAST <= abs(value) <= MOST
    ]


def apply_override(data: dict[str, Any], override: str) -> str | None:
    """Apply "key.path=value" to raw tables; "key.path=" removes the key. Returns a fault if there is no such key, else
    None."""
    path, equals, text = override.partition("=")
    keys = path.strip().split(".")
    if not equals or not all(keys):
        return f"--set {override}: expected key.path=value, found {describe(override)}"
    place: Any = data
    removes = not text.strip()
    key: Any
    for depth, key in enumerate(keys):
        last = depth == len(keys) - 1
        if isinstance(place, list):
            if not key.isdigit() or int(key) >= len(place):
                expected = f"an index from 0 to {len(place) - 1}" if place else "no index, the list is empty"
                return (
                    f"--set {path.strip()}: expected {expected} after {key_path(keys[:depth])}, found {describe(key)}"
                )
            key = int(key)
        elif not isinstance(place, dict):
            return f"--set {path.strip()}: expected a table at {key_path(keys[:depth])}, found {describe(place)}"
        elif removes and key not in place:
            table = f"{describe(place)} at {key_path(keys[:depth])}"
            return f"--set {path.strip()}: expected a key of {table}, found {describe(key)}{suggestion(key, place)}"
        if last and removes:
            del place[key]
        elif last:
            place[key] = override_value(text.strip())
        else:
            place = place[key] if isinstance(place, list) else place.setdefault(key, {})
    return None


def toml_value(value: Any) -> str:
    """A value in one line of TOML, as for --set key=value."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, dict):
        # tomli_w quotes a key if necessary
        keys = [tomli_w.dumps({key: 0}).removesuffix(" = 0\n") for key in value]
        return "{ " + ", ".join(f"{key} = {toml_value(entry)}" for key, entry in zip(keys, value.values())) + " }"
    if isinstance(value, float) and float(short := f"{value:g}") == value:
        return short
    return tomli_w.dumps({"v": value}).removeprefix("v = ").removesuffix("\n")


def override_value(text: str) -> Any:
    """The value of a TOML text or of a number like "1." or ".5", otherwise the text itself."""
    if _SHORT_NUMBER.fullmatch(text):
        return float(text)
    try:
        tables = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return tables["value"] if len(tables) == 1 else text
