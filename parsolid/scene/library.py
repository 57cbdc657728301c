"""Entries of libraries of materials, as a table's key `library` names them."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import model_validator

from parsolid.scene.base_model import reject
from parsolid.scene.declared import DeclaredModel
from parsolid.scene.validation_errors import suggestion

Entry = TypeVar("Entry")


def stated_sets(path: Path) -> dict[str, dict[str, Any]]:
    """Name -> what each set of a library's TOML file states, without where it was published."""
    with open(path, "rb") as file:
        tables = tomllib.load(file)
    return {name: {key: value for key, value in table.items() if key != "source"} for name, table in tables.items()}


def entry(name: object, known: Mapping[str, Entry]) -> Entry:
    """The entry of a name; raises ValidationError at the key `library` for what is no name of one."""
    if not isinstance(name, str) or name not in known:
        expected = f"one of {', '.join(map(repr, known)) or 'none'}{suggestion(name, known)}"
        reject((("library",), expected, name))
    return known[str(name)]


class LibraryTable(DeclaredModel):
    """What is not given is that of the library, if one is named."""

    @classmethod
    def entries(cls) -> Mapping[str, dict[str, Any]]:
        """The library."""
        raise NotImplementedError

    @classmethod
    def taken(cls, known: dict[str, Any], stated: dict[str, Any]) -> dict[str, Any]:
        """What is taken of an entry beside what the scene states: all of it."""
        return known

    @model_validator(mode="wrap")
    @classmethod
    def _with_library(cls, value: Any, handler: Any) -> Any:
        name = value.get("library") if isinstance(value, dict) else None
        if name is None:
            return handler(value)
        given = {key: stated for key, stated in value.items() if stated is not None}
        return handler(cls.taken(entry(name, cls.entries()), given) | given)
