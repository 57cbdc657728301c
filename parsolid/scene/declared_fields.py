"""Fields that the code of a scene's systems declares, for a scene that names one which no table of names has."""

from collections.abc import Callable
from functools import cached_property
from importlib import import_module
from typing import Any

from parsolid.scene.validation_errors import SceneError


class DeclaredFields:
    """What the systems of a scene declare; their code is loaded only when it is asked for."""

    def __init__(self, read: Callable[[], Any]) -> None:
        """read: gives the scene's method and bodies, without what names fields; may raise SceneError."""
        self._read = read
        self.faults: list[str] = []

    @cached_property
    def kinds(self) -> dict[str, str] | None:
        """Name -> kind; None where other faults of the scene keep it from being known."""
        try:
            scene = self._read()
        except SceneError as error:
            self.faults = error.faults
            return None
        kinds: dict[str, str] = import_module("parsolid.methods.small_scene").declared_kinds(scene)
        return kinds
