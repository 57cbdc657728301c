"""A small scene of a method, with comments, and with the method's other keys to choose from."""

import re
import tomllib
from collections import Counter
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from parsolid.collective import SolverError, raise_together
from parsolid.commands.keys.description import Key, Table
from parsolid.scene.methods import method_kinds
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import suggestion

_HEADER = re.compile(r"^\[+([A-Za-z_.]+)\]+$")
_KEY = re.compile(r"^([A-Za-z_]+) = ")
_COLUMN = 60


def write_scene(comm: Any, method: str, path: str) -> None:
    """Write a scene to start from. Collective: rank 0 writes. Raises SolverError on all ranks."""
    if method not in method_kinds():
        known = f"expected one of {', '.join(method_kinds())}{suggestion(method, method_kinds())}"
        raise SolverError(f"--new: {known}, found {method!r}")
    fault = None
    if comm.rank == 0:
        try:
            with open(Path(path), "x", encoding="utf-8") as file:
                file.write(starting_scene(method))
            print(f"{path}: try `parsolid run {path} --ranks 2`", flush=True)
        except FileExistsError:
            fault = f"{path}: expected a name that is free, found a file, which stays as it is"
        except OSError as error:
            fault = f"{path}: cannot be written: {error.strerror}"
    raise_together(comm, fault)


def starting_scene(method: str) -> str:
    """The text of a small scene of a method, which runs in seconds."""
    text = (files("parsolid.methods") / method / "example.toml").read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    lines: list[str] = []
    scene = Table.of(Scene)
    open_keys = scene.keys
    place: list[str] = []
    # how many tables of each list have begun
    begun: Counter[str] = Counter()
    for line in text.splitlines():
        header, key = _HEADER.match(line), _KEY.match(line)
        if (header or not line) and place == ["method"]:
            lines += [_offered(one) for name, one in open_keys.items() if name not in tables["method"]]
            place = []
        if header:
            place = header[1].split(".")
            begun[header[1]] += 1
            open_keys = _table_at(scene, place, tables, begun).keys
        if key and key[1] in open_keys:
            line = _commented(line, open_keys.pop(key[1]).meaning)
        lines.append(line)
    return "\n".join(lines) + "\n"


def _table_at(table: Table, place: list[str], tables: Any, begun: Mapping[str, int]) -> Table:
    """A table within another, by the kinds that the scene states; of a list, of the last table that has begun."""
    for depth, word in enumerate(place, 1):
        listed = isinstance(tables[word], list)
        tables = tables[word][begun[".".join(place[:depth])] - 1] if listed else tables[word]
        kinds = table.keys[word].tables
        table = kinds[""] if "" in kinds else kinds[tables["kind"]]
    return table


def _commented(line: str, meaning: str) -> str:
    return f"{line:<{_COLUMN}}  # {meaning}" if meaning else line


def _offered(key: Key) -> str:
    """A key that the scene does not state, as a comment."""
    takes = key.words if key.default in (None, "none", "as its keys") else key.default
    return _commented(f"# {key.name} = {takes}", key.meaning)
