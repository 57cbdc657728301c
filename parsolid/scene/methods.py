"""Tables of methods, chosen by `kind`: the settings of every folder of `parsolid.methods`.

A scene has one method for all bodies, `[method]`, or several named ones, `[[methods]]`, of which each body names one.
"""

import os
from collections import ChainMap
from collections.abc import Iterator
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any, Union

from pydantic import Field

from parsolid.materials import registry
from parsolid.scene.base_model import FaultDetail, kinds_of, value_at
from parsolid.scene.boundaries import BOUNDARY_KINDS
from parsolid.scene.materials import ROLES_OF_MATERIALS
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


def _tables_of_methods(data: dict[str, Any]) -> list[Any]:
    """Raw tables of the method, or of several."""
    several = data.get("methods") if "method" not in data else None
    return several if isinstance(several, list) else [data.get("method")]


def known_methods(data: dict[str, Any]) -> list[type[MethodSettings]]:
    """Settings classes of the methods in raw tables whose kinds are known."""
    return [settings for settings in map(settings_class, _tables_of_methods(data)) if settings is not None]


def named_methods(data: dict[str, Any]) -> dict[str, type[MethodSettings] | None]:
    """Settings classes of several methods in raw tables by name; None for a method that is not known."""
    tables = [table for table in _tables_of_methods(data) if isinstance(table, dict)] if "methods" in data else []
    return {table["name"]: settings_class(table) for table in tables if isinstance(table.get("name"), str)}


def refused_kinds(data: dict[str, Any]) -> list[FaultDetail]:
    """Faults of kinds of materials and boundaries, and of loads, in raw tables that their methods do not accept."""
    named, only = named_methods(data), settings_class(data.get("method"))
    whose = "body" if named else "scene"
    by_body: dict[str, type[MethodSettings] | None] = {}
    details: list[FaultDetail] = []
    roles = {kind: role for role in ROLES_OF_MATERIALS for kind in registry.kinds(role)}
    for i, body in enumerate(_tables(data, "bodies")):
        name = body.get("method", next(iter(named), None) if len(named) == 1 else None)
        settings = named.get(name) if named and isinstance(name, str) else only
        if isinstance(body.get("name"), str):
            by_body[body["name"]] = settings
        kind = value_at(body, ("material", "kind"))
        if settings and isinstance(kind, str) and roles.get(kind, settings.materials[0]) not in settings.materials:
            known = ", ".join(repr(kind) for role in settings.materials for kind in registry.kinds(role))
            expected = f"one of {known}, which the method of the {whose} knows"
            details.append((("bodies", i, "material", "kind"), expected, kind, "method"))
    for i, boundary in enumerate(_tables(data, "boundaries")):
        kind, name = boundary.get("kind"), boundary.get("body")
        near = [by_body[name]] if isinstance(name, str) and name in by_body else list(named.values()) or [only]
        if not isinstance(kind, str) or kind not in BOUNDARY_KINDS:
            continue
        if any(one is None or kind in one.boundaries for one in near):
            continue
        known = ", ".join(map(repr, dict.fromkeys(kind for one in near if one for kind in one.boundaries)))
        why = near[0].refused.get(kind) if near[0] and len(near) == 1 else None
        reason = f" ({kind}: {why})" if why else ""
        expected = f"one of {known}, which the method of the {whose} knows{reason}"
        details.append((("boundaries", i, "kind"), expected, kind, "method"))
    loads = list(dict.fromkeys(key for one in known_methods(data) for key in one.loads))
    others = {key for one in SETTINGS.values() for key in one.loads} - {*loads}
    if loads and isinstance(stated := data.get("loads"), dict):
        unknown = [key for key in stated if key in others]
        details += [(("loads", key), f"one of {', '.join(loads)} with this method", key) for key in unknown]
    return details


def _tables(data: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The tables of a list in raw tables; empty tables in place of other values."""
    stated = data.get(key)
    return [one if isinstance(one, dict) else {} for one in stated] if isinstance(stated, list) else []


def context_of(data: dict[str, Any], folder: str | os.PathLike[str]) -> dict[str, Any]:
    """The context in which the tables of a scene are validated, from the raw tables.

    dimension: None if it is not valid; dimensions: those of all methods; fields, quantities: those of any method, name
    -> kind, None if a method is not known; methods: names of several methods; folder: of files named in the scene
    """
    tables, known = _tables_of_methods(data), known_methods(data)
    dimensions = tuple(d for d in (1, 2, 3) if all(d in settings.dimensions for settings in known))
    dimension = data.get("dimension")
    is_integer = isinstance(dimension, int) and not isinstance(dimension, bool)
    dimension = dimension if is_integer and dimension in dimensions else None
    all_known = 0 < len(known) == len(tables)
    return {
        "dimension": dimension,
        "dimensions": dimensions,
        "fields": dict(ChainMap(*(one.field_kinds(dimension) for one in known))) if all_known else None,
        "quantities": dict(ChainMap(*(one.extra_quantities for one in known))) if all_known else None,
        "methods": list(named_methods(data)) if tables is data.get("methods") else None,
        "folder": os.path.abspath(folder),
    }
