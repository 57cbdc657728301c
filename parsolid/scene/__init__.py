"""Scenes: what a TOML file may say.

Names are looked up when they are first used: the settings of methods, which a scene reads, import from this package
themselves.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from parsolid.scene.loading import dump_scene, load_scene, packaged_scene, parse_scene
    from parsolid.scene.schema import Scene
    from parsolid.scene.validation_errors import SceneError

__all__ = ["Scene", "SceneError", "dump_scene", "load_scene", "packaged_scene", "parse_scene"]

_HOMES = {
    "Scene": "parsolid.scene.schema",
    "SceneError": "parsolid.scene.validation_errors",
    **dict.fromkeys(("dump_scene", "load_scene", "packaged_scene", "parse_scene"), "parsolid.scene.loading"),
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
