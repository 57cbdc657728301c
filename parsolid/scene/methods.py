"""Methods as a scene states them: the settings of every folder of `parsolid.methods`, told apart by their `kind`.

A scene has one method for all bodies, `[method]`, or several with names, `[[methods]]`, of which each body names one.
"""

import functools
import os
from collections.abc import Iterator, Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, create_model, model_serializer

from parsolid.scene.base_model import ByKind, SceneModel, kinds_of, mismatch, reject
from parsolid.scene.bodies import Name, own_method
from parsolid.scene.method_settings import MethodSettings
from parsolid.scene.validation_errors import NOTHING


class _Tables(Mapping[str, type[MethodSettings]]):
    """Kind -> the class of settings of every method; a new method is a new folder, found here.

    A method's `settings` module is imported when it is asked for by its kind, if that is the folder's name, and all are
    when anything else is asked: a scene has one method, and tables of all are slow to make.
    """

    @functools.cached_property
    def _rooms(self) -> list[str]:
        return [room.name for room in iter_modules(import_module("parsolid.methods").__path__) if room.ispkg]

    @functools.cached_property
    def _all(self) -> dict[str, type[MethodSettings]]:
        return {kind: model for room in self._rooms for kind, model in _settings_in(room).items()}

    def __getitem__(self, kind: str) -> type[MethodSettings]:
        own = _settings_in(kind) if kind in self._rooms else {}
        return own[kind] if kind in own else self._all[kind]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all)

    def __len__(self) -> int:
        return len(self._all)


@functools.cache
def _settings_in(room: str) -> dict[str, type[MethodSettings]]:
    """Kind -> class of what the `settings` module of a method's folder defines."""
    module = import_module(f"parsolid.methods.{room}.settings")
    found = [one for one in vars(module).values() if _is_defined_in(one, module.__name__)]
    return {kind: one for one in found for kind in kinds_of(one)}


def _is_defined_in(thing: object, module: str) -> bool:
    return isinstance(thing, type) and issubclass(thing, MethodSettings) and thing.__module__ == module


_SETTINGS = _Tables()
Method: Any = Annotated[Any, ByKind(_SETTINGS)]


def method_kinds() -> tuple[str, ...]:
    """Names of all methods."""
    return tuple(ByKind(_SETTINGS).models)


def settings_class(table: object) -> type[MethodSettings] | None:
    """The class of a raw table's settings; None when it names no method."""
    kinds: Any = ByKind(_SETTINGS)
    chosen: type[MethodSettings] | None = kinds.choose(table)
    return chosen


class NamedMethod(SceneModel):
    """One of several methods of a scene: its name and its settings, which stand in one table."""

    name: Name
    settings: Any

    @model_serializer
    def _one_table(self) -> dict[str, Any]:
        return {"name": self.name} | self.settings.model_dump(exclude_none=True)


class _NamedTable(ByKind):
    """Annotation of a table with the key name and those of a method."""

    @property
    def instances(self) -> tuple[type, ...]:
        """What needs no validation any more."""
        return (NamedMethod,)

    def tables(self) -> dict[str, type[SceneModel]]:
        """Every method's table with the key name."""
        name: Any = (Name, Field(description="by which bodies call the method"))
        return {
            kind: create_model(f"Named{model.__name__}", __base__=model, __doc__=model.__doc__, name=name)
            for kind, model in self.models.items()
        }

    def _validate(self, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, NamedMethod):
            return value
        if not isinstance(value, dict):
            raise mismatch("a table", value)
        if not isinstance(value.get("name"), str):
            reject(
                (("name",), "a name without '.' and ',', by which bodies call the method", value.get("name", NOTHING))
            )
        settings = super()._validate({key: part for key, part in value.items() if key != "name"}, info)
        return NamedMethod.model_validate({"name": value["name"], "settings": settings}, context=info.context)


NamedMethodTable: Any = Annotated[Any, _NamedTable(_SETTINGS)]


class JoinedMethods:
    """What several methods know together, for tables that are for the bodies of all."""

    def __init__(self, classes: list[type[MethodSettings]]) -> None:
        self.classes = classes

    def _joined(self, attribute: str) -> tuple[Any, ...]:
        return tuple(dict.fromkeys(one for each in self.classes for one in getattr(each, attribute)))

    @property
    def dimensions(self) -> tuple[int, ...]:
        """Those that every method knows."""
        return tuple(d for d in (1, 2, 3) if all(d in each.dimensions for each in self.classes))

    @property
    def boundaries(self) -> tuple[str, ...]:
        """Kinds that any method knows."""
        return self._joined("boundaries")

    @property
    def loads(self) -> tuple[str, ...]:
        """Keys that any method knows."""
        return self._joined("loads")

    @property
    def pictured_fields(self) -> tuple[str, ...]:
        """What colours the bodies, the first that was written."""
        return self._joined("pictured_fields")

    @property
    def ledger_terms(self) -> tuple[str, ...]:
        """Names of the energy terms of all."""
        return self._joined("ledger_terms")

    @property
    def extra_quantities(self) -> dict[str, str]:
        """Name -> kind of the quantities that any method computes."""
        return {name: kind for each in self.classes for name, kind in each.extra_quantities.items()}

    def field_kinds(self, dimension: int | None) -> dict[str, str]:
        """Name -> kind of the fields that any method is known to have."""
        return {name: kind for each in self.classes for name, kind in each.field_kinds(dimension).items()}


def context_of(data: dict[str, Any], folder: str | os.PathLike[str]) -> dict[str, Any]:
    """What the tables of a scene are validated with, from the raw ones.

    method: the class of the scene's method, or of several what they know together; None where it is not known. methods:
    name -> class of several, None with one; method_of_body: name of a body -> class.
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
    sound = isinstance(dimension, int) and dimension in (method.dimensions if method else (1, 2, 3))
    bodies = data.get("bodies") if isinstance(data.get("bodies"), list) else []
    context = {"dimension": dimension if sound else None, "method": method, "methods": named}
    of_body = {str(b.get("name")): own_method(b, context) for b in bodies or () if isinstance(b, dict) and "name" in b}
    return context | {"method_of_body": of_body if named else {}, "folder": os.path.abspath(folder)}
