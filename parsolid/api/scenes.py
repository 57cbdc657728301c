"""Scenes made in Python or read from TOML files, and checks of other arguments of the Python interface."""

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
    """Raise SolverError unless the value is an integer of at least 1."""
    if isinstance(value, bool) or not (isinstance(value, Integral) and int(value) >= 1):
        raise SolverError(f"{name}: expected a whole number of at least 1, found {value!r}")


def require_seconds(name: str, value: Any) -> None:
    """Raise SolverError unless the value is a positive finite number."""
    if isinstance(value, bool) or not (isinstance(value, Real) and 0.0 < float(value) < float("inf")):
        raise SolverError(f"{name}: expected a positive number of seconds, found {value!r}")


def require_part(name: str, value: Any) -> None:
    """Raise SolverError unless the value is a number between 0 and 1."""
    if isinstance(value, bool) or not (isinstance(value, Real) and 0.0 < float(value) < 1.0):
        raise SolverError(f"{name}: expected a number between 0 and 1, found {value!r}")


def require_texts(name: str, value: Any) -> None:
    """Raise SolverError unless the value is a list of texts."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise SolverError(f"{name}: expected a list of texts, found {value!r}")


Table = Mapping[str, Any]
Tables = Sequence[Table]
# default folder of results of a scene without a file
DIRECTORY = "results/scene"


class Scene(SceneModel):
    """A scene from the tables of a TOML file; `parsolid keys` lists their keys.

    folder: of files named in the scene (default: the working folder); trust_code: execute files of laws that the scene
    names. Raises SceneError with all faults.
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
        tables = {name: value for name, value in locals().items() if name in SceneModel.model_fields}
        given = {name: value for name, value in tables.items() if value is not None and value != ()}
        scene = scene_of_tables(given | more, folder, trust_code)
        for name in ("__dict__", "__pydantic_fields_set__", "__pydantic_extra__", "__pydantic_private__"):
            object.__setattr__(self, name, getattr(scene, name))


AnyScene = str | Path | dict[str, Any] | SceneModel


def scene_of_tables(
    tables: Table, folder: str | Path = ".", trust_code: bool = False, overrides: Sequence[str] = ()
) -> SceneModel:
    """A scene from tables, with overrides "key.path=value". Raises SceneError with all faults."""
    changed = copy.deepcopy({name: _plain(value) for name, value in tables.items()})
    _override(changed, overrides)
    if isinstance(output := changed.setdefault("output", {}), dict):
        output.setdefault("directory", DIRECTORY)
    return parse_scene(changed, os.path.abspath(folder), trust_code)


def read_scene(scene: AnyScene, overrides: Sequence[str] = (), trust_code: bool = False) -> SceneModel:
    """A scene from a TOML file, from tables, or the Scene itself. Raises SceneError with all faults."""
    if isinstance(scene, SceneModel):
        if not overrides:
            return scene
        tables = scene.resolved()
        _override(tables, overrides)
        return parse_scene(tables, trust_code=trust_code)
    if isinstance(scene, dict):
        return scene_of_tables(scene, trust_code=trust_code, overrides=overrides)
    if not isinstance(scene, str | os.PathLike):
        raise SceneError([f"scene: expected a Scene, a TOML file or a dict of tables, found {scene!r}"])
    return load_scene(scene, list(overrides), trust_code)


def scene_on_all_ranks(comm: Any, read: Callable[[], SceneModel]) -> SceneModel:
    """The scene that rank 0 reads, on all ranks. Raises SceneError on all ranks."""
    scene = faults = None
    if comm.rank == 0:
        try:
            scene = read()
        except SceneError as error:
            faults = error.faults
    result: SceneModel
    result, faults = comm.bcast((scene, faults))
    if faults is not None:
        raise SceneError(faults)
    return result


def _override(tables: dict[str, Any], overrides: Sequence[str]) -> None:
    if faults := [fault for fault in (apply_override(tables, override) for override in overrides) if fault]:
        raise SceneError(faults)


def _plain(value: Any) -> Any:
    """A value with tuples and numpy arrays replaced by lists, and numpy numbers by Python numbers."""
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value.tolist() if hasattr(value, "tolist") else value
