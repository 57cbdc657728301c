"""From a TOML file to a scene, and back."""

import os
from importlib.resources import files
from pathlib import Path
from typing import Any

import tomli_w

from parsolid.checksums import with_checksum
from parsolid.scene.checks import check_scene
from parsolid.scene.error_recovery import validate_with_recovery
from parsolid.scene.methods import context_of
from parsolid.scene.raw_tables import apply_override, raw_faults, read_tables
from parsolid.scene.schema import Scene
from parsolid.scene.systems import resolve_defaults
from parsolid.scene.validation_errors import SceneError


def packaged_scene() -> Path:
    """The path of the scene that comes with the package."""
    return Path(str(files("parsolid") / "scenes" / "twisting_column.toml"))


def load_scene(
    path: str | os.PathLike[str], overrides: list[str] | tuple[str, ...] = (), trust_code: bool = False
) -> Scene:
    """Read a scene; `overrides` are "key.path=value" with TOML values, applied before validation.

    Files named in the scene are relative to its folder; trust_code: laws in them are run.
    Raises SceneError with every fault.
    """
    path = Path(path)
    data = read_tables(path, "scene")
    faults = [text for text in (apply_override(data, override) for override in overrides) if text]
    if isinstance(output := data.setdefault("output", {}), dict):
        output.setdefault("directory", os.path.join("results", path.stem))
    try:
        scene = parse_scene(data, path.resolve().parent, trust_code)
    except SceneError as error:
        raise SceneError(faults + error.faults) from None
    if faults:
        raise SceneError(faults)
    return scene


def parse_scene(
    data: dict[str, Any], folder: str | os.PathLike[str] = ".", trust_code: bool = False, again: bool = False
) -> Scene:
    """A scene from plain tables; files are relative to `folder`; trust_code: laws in files are run, else refused;
    again: the tables are made from a scene of this process, and their laws are those that came with it.

    Raises SceneError with every fault.
    """
    if raw := raw_faults(data):
        raise SceneError(raw)
    context = context_of(data, folder)
    context |= {"trust_code": trust_code, "again": again}
    scene, repairs, faults = validate_with_recovery(data, context)
    if scene is not None:
        scene = resolve_defaults(scene) if repairs.systems_known else scene
        faults += check_scene(scene, repairs)
    if faults:
        raise SceneError(dict.fromkeys(faults))
    return scene


def dump_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write the resolved scene as TOML with its checksum, beside and renamed; it loads again to the same scene."""
    partial = Path(f"{os.fspath(path)}.partial")
    partial.write_text(with_checksum(tomli_w.dumps(scene.resolved())), encoding="utf-8")
    os.replace(partial, path)
