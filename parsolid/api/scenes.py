"""Scenes made in Python, or read from TOML files, and checks of what else the Python interface is given."""

import copy
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any

from parsolid.collective import SolverError
from parsolid.scene import Scene as SceneModel
from parsolid.scene import SceneError, load_scene, parse_scene
from parsolid.scene.raw_tables import apply_override


def require_whole_number(name: str, value: Any) -> None:
    """Raise SolverError for what is no whole number of at least 1."""
    if isinstance(value, bool) or not (isinstance(value, Integral) and int(value) >= 1):
        raise SolverError(f"{name}: expected a whole number of at least 1, found {value!r}")


def require_seconds(name: str, value: Any) -> None:
    """Raise SolverError for what is no positive number of seconds."""
    if isinstance(value, bool) or not (isinstance(value, Real) and 0.0 < float(value) < float("inf")):
        raise SolverError(f"{name}: expected a positive number of seconds, found {value!r}")


def require_part(name: str, value: Any) -> None:
    """Raise SolverError for what is no number between 0 and 1."""
    if isinstance(value, bool) or not (isinstance(value, Real) and 0.0 < float(value) < 1.0):
        raise SolverError(f"{name}: expected a number between 0 and 1, found {value!r}")


def require_texts(name: str, value: Any) -> None:
    """Raise SolverError for what is no list of texts."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise SolverError(f"{name}: expected a list of texts, found {value!r}")


Table = Mapping[str, Any]
Tables = Sequence[Table]
# of the output of a scene that has no file
DIRECTORY = "results/scene"


class Scene(SceneModel):
    """A scene from the tables that a TOML file has; `parsolid keys` lists what each may say.

    Files are relative to `folder`, the working folder unless given; trust_code: laws in files that the scene names are
    run. Raises SceneError with every fault.
    """

    def __init__(
        self,
        *,
        dimension: int,
        end_time: float,
        bodies: Tables,
        method: Table | None = None,
        methods: Tables = (),
        title: str = "",
        regions: Tables = (),
        boundaries: Tables = (),
        initial: Tables = (),
        loads: Table | None = None,
        contact: Tables = (),
        bond: Tables = (),
        undeclared_contact: str | None = None,
        tie: Tables = (),
        tools: Tables = (),
        probes: Tables = (),
        output: Table | None = None,
        reference: Table | None = None,
        errors: Table | None = None,
        run: Table | None = None,
        folder: str | Path = ".",
        trust_code: bool = False,
        **more: Any,
    ) -> None:
        stated = {name: value for name, value in locals().items() if name in SceneModel.model_fields}
        given = {name: value for name, value in stated.items() if value is not None and value != ()}
        made = scene_of_tables(given | more, folder, trust_code)
        for name in ("__dict__", "__pydantic_fields_set__", "__pydantic_extra__", "__pydantic_private__"):
            object.__setattr__(self, name, getattr(made, name))


AnyScene = str | Path | dict[str, Any] | SceneModel


def scene_of_tables(
    tables: Table, folder: str | Path = ".", trust_code: bool = False, overrides: Sequence[str] = ()
) -> SceneModel:
    """A scene of its tables, changed by overrides as `load_scene` takes them. Raises SceneError with every fault."""
    changed = copy.deepcopy({name: _plain(value) for name, value in tables.items()})
    if faults := [text for text in (apply_override(changed, override) for override in overrides) if text]:
        raise SceneError(faults)
    if isinstance(output := changed.setdefault("output", {}), dict):
        output.setdefault("directory", DIRECTORY)
    return parse_scene(changed, os.path.abspath(folder), trust_code)


def read_scene(scene: AnyScene, overrides: Sequence[str] = (), trust_code: bool = False) -> SceneModel:
    """A scene of a TOML file, of tables, or as it is. Raises SceneError with every fault."""
    if isinstance(scene, SceneModel):
        return parse_scene(_changed(scene, overrides), trust_code=trust_code) if overrides else scene
    if isinstance(scene, dict):
        return scene_of_tables(scene, trust_code=trust_code, overrides=overrides)
    if not isinstance(scene, str | os.PathLike):
        raise SceneError([f"scene: expected a Scene, a TOML file or a dict of tables, found {scene!r}"])
    return load_scene(scene, list(overrides), trust_code)


def scene_on_all_ranks(comm: Any, read: Callable[[], SceneModel]) -> SceneModel:
    """What rank 0 alone reads, the same on all ranks. Raises SceneError on all ranks."""
    scene = error = None
    if comm.rank == 0:
        try:
            scene = read()
        except SceneError as found:
            error = found.faults
    known: SceneModel
    known, error = comm.bcast((scene, error))
    if error is not None:
        raise SceneError(error)
    return known


def _changed(scene: SceneModel, overrides: Sequence[str]) -> dict[str, Any]:
    tables = scene.resolved()
    if faults := [text for text in (apply_override(tables, override) for override in overrides) if text]:
        raise SceneError(faults)
    return tables


def _plain(value: Any) -> Any:
    """Tables and lists of Python and numpy as TOML has them."""
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value.tolist() if hasattr(value, "tolist") else value
