"""Tables of methods, chosen by `kind`: the settings of every folder of `parsolid.methods`.

A scene has one method for all bodies, `[method]`, or several named ones, `[[methods]]`, of which each body names one.
"""

import os
from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any, Union

from pydantic import Field

from parsolid.scene.base_model import kinds_of
from parsolid.scene.bodies import own_method
from parsolid.scene.method_settings import MethodSettings


def _settings_classes() -> Iterator[type[MethodSettings]]:
    """The subclasses of MethodSettings that the module `settings` of each folder of methods defines."""
    for package in iter_modules(import_module("parsolid.methods").__path__):
        if package.ispkg:
            module = import_module(f"parsolid.methods.{package.name}.settings")
            for one in vars(module).values():
                if isinstance(one, type) and issubclass(one, MethodSettings) and one.__module__ == module.__name__:
                    yield one


SETTINGS = {kind: settings for settings in _settings_classes() for kind in kinds_of(settings)}
Method: Any = Annotated[Union[tuple(SETTINGS.values())], Field(discriminator="kind")]  # noqa: UP007


def method_kinds() -> tuple[str, ...]:
    """Names of all methods."""
    return tuple(SETTINGS)


def settings_class(table: object) -> type[MethodSettings] | None:
    """The settings class of a raw table; None if its kind is not that of a method."""
    kind = table.get("kind") if isinstance(table, dict) else None
    return SETTINGS.get(kind) if isinstance(kind, str) else None


class JoinedMethods:
    """What several methods know together, for tables that are for the bodies of all."""

    def __init__(self, classes: list[type[MethodSettings]]) -> None:
        """dimensions: those that every method knows; else what any knows, in the order of the methods."""
        self.classes = classes
        self.dimensions = tuple(d for d in (1, 2, 3) if all(d in one.dimensions for one in classes))
        self.boundaries, self.loads, self.pictured_fields, self.ledger_terms = (
            tuple(dict.fromkeys(word for one in classes for word in getattr(one, attribute)))
            for attribute in ("boundaries", "loads", "pictured_fields", "ledger_terms")
        )
        self.extra_quantities = {name: kind for one in classes for name, kind in one.extra_quantities.items()}

    def field_kinds(self, dimension: int | None) -> dict[str, str]:
        """Name -> kind of the fields that any of the methods has."""
        return {name: kind for each in self.classes for name, kind in each.field_kinds(dimension).items()}


def context_of(data: dict[str, Any], folder: str | os.PathLike[str]) -> dict[str, Any]:
    """The context in which the tables of a scene are validated, from the raw tables.

    dimension: None if it is not valid; method: settings class of the scene's method, or a `JoinedMethods` of several,
    None if it is not known; methods: name -> class of several methods, None with one; method_of_body: name of a body ->
    class; folder: of files named in the scene
    """
    named: dict[str, type[MethodSettings] | None] | None = None
    method: Any = settings_class(data.get("method"))
    if "method" not in data and isinstance(data.get("methods"), list):
        tables = [table for table in data["methods"] if isinstance(table, dict) and isinstance(table.get("name"), str)]
        named = {table["name"]: settings_class(table) for table in tables}
        known = [one for one in named.values() if one is not None]
        method = JoinedMethods(known) if known and len(known) == len(named) else None
        method = known[0] if method and len(known) == 1 else method
    dimension = data.get("dimension")
    is_integer = isinstance(dimension, int) and not isinstance(dimension, bool)
    if not is_integer or dimension not in (method.dimensions if method else (1, 2, 3)):
        dimension = None
    context = {"dimension": dimension, "method": method, "methods": named}
    method_of_body = {}
    if named and isinstance(data.get("bodies"), list):
        for body in data["bodies"]:
            if isinstance(body, dict) and "name" in body:
                method_of_body[str(body["name"])] = own_method(body, context)
    return context | {"method_of_body": method_of_body, "folder": os.path.abspath(folder)}
