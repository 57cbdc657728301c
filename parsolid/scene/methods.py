"""Methods as a scene states them: the settings of every folder of `parsolid.methods`, told apart by their `kind`."""

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from parsolid.scene.base_model import ByKind, by_kind
from parsolid.scene.method_settings import MethodSettings


def _settings_of_all_methods() -> tuple[type[MethodSettings], ...]:
    """The class that each method's `settings` module defines; a new method is a new folder, found here."""
    found = []
    for room in iter_modules(import_module("parsolid.methods").__path__):
        if room.ispkg:
            module = import_module(f"parsolid.methods.{room.name}.settings")
            found += [one for one in vars(module).values() if _is_defined_in(one, module.__name__)]
    return tuple(found)


def _is_defined_in(thing: object, module: str) -> bool:
    return isinstance(thing, type) and issubclass(thing, MethodSettings) and thing.__module__ == module


_SETTINGS = _settings_of_all_methods()
Method = by_kind(*_SETTINGS)


def method_kinds() -> tuple[str, ...]:
    """Names of all methods."""
    return tuple(ByKind(_SETTINGS).models)


def settings_class(table: object) -> type[MethodSettings] | None:
    """The class of a raw table's settings; None when it names no method."""
    kinds: Any = ByKind(_SETTINGS)
    chosen: type[MethodSettings] | None = kinds.choose(table)
    return chosen
