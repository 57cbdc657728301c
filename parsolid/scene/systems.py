"""A scene's systems: which method has which bodies."""

from typing import NamedTuple

from parsolid.scene.method_settings import MethodSettings


class SystemOfScene(NamedTuple):
    """Settings of a method, and the numbers of its bodies among those of the scene."""

    settings: MethodSettings
    bodies: tuple[int, ...]
