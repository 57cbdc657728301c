"""From a TOML file to a scene, and back."""

import os
import tomllib
from collections.abc import Iterator
from importlib.resources import files
from math import isfinite
from pathlib import Path
from typing import Any, get_args

import tomli_w
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import LEAST, MOST, ByKind, SceneModel, TableOr
from parsolid.scene.declared_fields import DeclaredFields
from parsolid.scene.methods import context_of
from parsolid.scene.schema import Parts, Scene, cross_faults
from parsolid.scene.validation_errors import SceneError, fault, key_path, suggestion, told

# tables and lists one within the other; a scene has no more than eight
DEEPEST = 32

_EXPECTED = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "a text",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "finite_number": "a finite number",
    "greater_than": "a number > {gt:g}",
    "greater_than_equal": "a number >= {ge:g}",
    "less_than": "a number < {lt:g}",
    "less_than_equal": "a number <= {le:g}",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "literal_error": "{expected}",
}


def packaged_scene(name: str = "twisting_column") -> Path:
    """The path of a scene that comes with the package."""
    return Path(str(files("parsolid") / "scenes" / f"{name}.toml"))


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


# a table that a file of a kind has to have, and the command that takes it
_MARKS = {"scene": "bodies", "study": "series", "material point": "path"}
_COMMANDS = {"scene": "run", "study": "study", "material point": "point"}


def read_tables(path: Path, what: str) -> dict[str, Any]:
    """The raw tables of a TOML file; `what` it should hold is for the message. Raises SceneError."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError([f"{path}: expected a readable {what}, found {error.strerror or error}"]) from None
    except ValueError as error:
        raise SceneError([f"{path}: expected TOML, found a fault: {error}"]) from None
    except RecursionError:
        raise SceneError([f"{path}: expected TOML, found tables or lists nested too deeply"]) from None
    if faults := _raw_faults(data):
        raise SceneError(faults)
    # one word for a file of another kind, in place of one for each of its keys
    own, others = _MARKS[what], {name: mark for name, mark in _MARKS.items() if name != what}
    if own not in data:
        for name, mark in others.items():
            if mark in data:
                raise SceneError([f"{path}: expected a {what}, found a {name}: parsolid {_COMMANDS[name]} {path}"])
    return data


def _values(data: dict[str, Any]) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Place and value of all that is no table or list, and of those that are nested too deeply."""
    waiting: list[tuple[tuple[Any, ...], Any]] = [((), data)]
    while waiting:
        place, value = waiting.pop()
        if len(place) > DEEPEST:
            yield place, value
        elif isinstance(value, dict):
            waiting += [((*place, key), part) for key, part in value.items()]
        elif isinstance(value, list):
            waiting += [((*place, number), part) for number, part in enumerate(value)]
        else:
            yield place, value


def _raw_faults(data: dict[str, Any]) -> list[str]:
    """What no key takes, whatever it is for: deep nesting, whole numbers that are not TOML's, texts with NUL."""
    faults: list[str] = []
    for place, value in _values(data):
        if len(place) > DEEPEST:
            faults.append(fault(place[:3], f"at most {DEEPEST} tables or lists one within the other", Phrase("more")))
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            faults.append(fault(place, "a whole number of 64 bits, as TOML has them", Phrase("a larger one")))
        elif isinstance(value, str) and "\0" in value:
            faults.append(fault(place, "a text without NUL", value))
    return list(dict.fromkeys(faults))


def _immoderate_numbers(data: dict[str, Any]) -> list[str]:
    """What is said of numbers that are too large or too small to compute with."""
    return [
        fault(place, f"0 or a number of a size from {LEAST:g} to {MOST:g}", value)
        for place, value in _values(data)
        if isinstance(value, float) and isfinite(value) and value and not LEAST <= abs(value) <= MOST
    ]


def parse_scene(
    data: dict[str, Any], folder: str | os.PathLike[str] = ".", trust_code: bool = False, again: bool = False
) -> Scene:
    """A scene from plain tables; files are relative to `folder`; trust_code: laws in files are run, else refused;
    again: the tables are made from a scene of this process, and their laws are those that came with it.

    Raises SceneError with every fault.
    """
    if raw := _raw_faults(data):
        raise SceneError(raw)
    context = context_of(data, folder)
    context |= {"trust_code": trust_code, "again": again}
    without_names: dict[str, Any] = {
        key: data[key] for key in ("dimension", "end_time", "method", "methods", "bodies") if key in data
    }
    declared_fields = DeclaredFields(lambda: parse_scene(without_names, folder, trust_code, again))
    context["declared_fields"] = declared_fields
    scene: Any = None
    faults: list[str] = []
    try:
        scene = Scene.model_validate(data, context=context)
    except ValidationError as error:
        faults = told_faults(error, data, Scene)
    immoderate = [
        more for more in _immoderate_numbers(data) if not any(one.startswith(more.split(":")[0]) for one in faults)
    ]
    if immoderate:
        raise SceneError(dict.fromkeys(faults + immoderate))
    parts = Parts.of(data, context)
    faults += cross_faults(parts) if parts is not None else []
    # faults that kept a name from being judged; all are among those found, unless a table makes up for another
    faults = faults or declared_fields.faults
    if faults:
        raise SceneError(dict.fromkeys(faults))
    return scene


def dump_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write the resolved scene as TOML, beside and renamed; it loads again to the same scene."""
    partial = Path(f"{os.fspath(path)}.partial")
    partial.write_text(tomli_w.dumps(scene.resolved()), encoding="utf-8")
    os.replace(partial, path)


def apply_override(data: dict[str, Any], override: str) -> str | None:
    """Set one "key.path=value" in raw tables, or take the key away with "key.path=": what else there is then holds. The
    fault when there is no such place, else None."""
    path, equals, text = override.partition("=")
    keys = path.strip().split(".")
    if not equals or not all(keys):
        return f"--set {override}: expected key.path=value, found {told(override)}"
    place: Any = data
    key: Any
    for depth, key in enumerate(keys):
        last = depth == len(keys) - 1
        if isinstance(place, list):
            if not key.isdigit() or int(key) >= len(place):
                expected = f"an index from 0 to {len(place) - 1}" if place else "no index, the list is empty"
                return f"--set {path.strip()}: expected {expected} after {key_path(keys[:depth])}, found {told(key)}"
            key = int(key)
        elif not isinstance(place, dict):
            return f"--set {path.strip()}: expected a table at {key_path(keys[:depth])}, found {told(place)}"
        if last and not text.strip():
            place.pop(key) if isinstance(place, list) else place.pop(key, None)
        elif last:
            place[key] = override_value(text.strip())
        else:
            place = place[key] if isinstance(place, list) else place.setdefault(key, {})
    return None


def override_value(text: str) -> Any:
    """A TOML value, or the text itself where it is none."""
    try:
        tables = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return tables["value"] if len(tables) == 1 else text


def told_faults(error: ValidationError, data: dict[str, Any], model: type[SceneModel]) -> list[str]:
    """What pydantic found wrong with the raw tables of a model, in the words of the project."""
    return [_told_fault(item, data, model) for item in error.errors(include_url=False)]


def _told_fault(error: Any, data: dict[str, Any], model: type[SceneModel]) -> str:
    place, kind, found = error["loc"], error["type"], error["input"]
    if kind == "mismatch":
        return f"{key_path(place)}: {error['ctx']['text']}"
    section = _section_at(place[:-1], data, model)
    fields = section.model_fields if section is not None else {}
    if kind == "extra_forbidden":
        unknown = f"the unknown key {place[-1]!r}{suggestion(place[-1], fields)}"
        return f"{key_path(place)}: expected one of {', '.join(fields)}, found {unknown}"
    field = fields.get(place[-1]) if place else None
    description = field.description if field is not None else None
    if kind == "missing":
        return f"{key_path(place)}: expected {description or 'a value'}, found nothing"
    template = _EXPECTED.get(kind)
    expected = template.format(**error.get("ctx", {})) if template else description or error["msg"]
    if kind == "literal_error":
        expected += suggestion(found, [word.strip("' ") for word in expected.replace(" or ", ",").split(",")])
    return f"{key_path(place)}: expected {expected}, found {told(found)}"


def _section_at(place: tuple[Any, ...], data: Any, model: type[SceneModel]) -> type[SceneModel] | None:
    """The model of the table at a place of a model's raw tables."""
    section: Any = model
    annotation: Any = model
    for key in place:
        data = data[key] if isinstance(data, dict | list) else None
        if isinstance(key, str):
            if section is None or key not in section.model_fields:
                return None
            annotation = section.model_fields[key]
        section = _model_of(annotation, data)
    return section


def _model_of(annotation: Any, value: Any) -> type[SceneModel] | None:
    """The model within an annotation (of a field, a list, an optional), by the value's kind where that decides."""
    if isinstance(annotation, FieldInfo):
        candidates = [*annotation.metadata, annotation.annotation]
    elif isinstance(annotation, ByKind):
        return annotation.choose(value)
    elif isinstance(annotation, TableOr):
        return annotation.model
    elif isinstance(annotation, type) and issubclass(annotation, SceneModel):
        return annotation
    else:
        candidates = [*getattr(annotation, "__metadata__", ()), *get_args(annotation)]
    models = (_model_of(candidate, value) for candidate in candidates)
    return next((model for model in models if model is not None), None)
