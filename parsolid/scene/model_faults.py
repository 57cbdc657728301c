"""What pydantic finds wrong with the tables of a model, as faults in the words of the project."""

from typing import Any, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from parsolid.scene.base_model import ByKind, OnRestart, SceneModel, TableOr
from parsolid.scene.validation_errors import Fault, describe, key_path, suggestion

# error of pydantic -> what it expects, and the code of the fault
_EXPECTED = {
    "float_type": ("a number", "type"),
    "int_type": ("a whole number", "type"),
    "int_from_float": ("a whole number", "type"),
    "string_type": ("a text", "type"),
    "bool_type": ("true or false", "type"),
    "list_type": ("a list", "type"),
    "dict_type": ("a table", "type"),
    "model_type": ("a table", "type"),
    "finite_number": ("a finite number", "bound"),
    "greater_than": ("a number > {gt:g}", "bound"),
    "greater_than_equal": ("a number >= {ge:g}", "bound"),
    "less_than": ("a number < {lt:g}", "bound"),
    "less_than_equal": ("a number <= {le:g}", "bound"),
    "too_short": ("a list of at least {min_length}", "length"),
    "too_long": ("a list of at most {max_length}", "length"),
    "literal_error": ("{expected}", "choice"),
}


def faults_of_errors(error: ValidationError, data: dict[str, Any], model: type[SceneModel]) -> list[Fault]:
    """The faults of the raw tables of a model."""
    return [fault_of_error(item, data, model) for item in error.errors(include_url=False)]


def fault_of_error(error: Any, data: dict[str, Any], model: type[SceneModel], stated: Any = None) -> Fault:
    """One of pydantic's errors as a fault; stated: where it is in the file, if that is not its place in the tables."""
    place, kind, found = error["loc"], error["type"], error["input"]
    key = key_path(place if stated is None else stated)
    if kind == "mismatch":
        return Fault(error["ctx"]["code"], key, error["ctx"]["expected"], error["ctx"]["found"])
    section = section_at(place[:-1], data, model)
    fields = section.model_fields if section is not None else {}
    if kind == "extra_forbidden":
        near = suggestion(place[-1], fields)
        return Fault("unknown-key", key, f"one of {', '.join(fields)}", f"the unknown key {place[-1]!r}", near)
    field = fields.get(place[-1]) if place else None
    description = field.description if field is not None else None
    if kind == "missing":
        return Fault("missing", key, description or "a value", "nothing")
    template, code = _EXPECTED.get(kind, ("", "refused"))
    expected = template.format(**error.get("ctx", {})) if template else description or error["msg"]
    if kind == "literal_error":
        expected += suggestion(found, [word.strip("' ") for word in expected.replace(" or ", ",").split(",")])
    return Fault(code, key, expected, describe(found))


def section_at(place: tuple[Any, ...], data: Any, model: type[SceneModel]) -> type[SceneModel] | None:
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


def on_restart(place: tuple[Any, ...], data: Any, model: type[SceneModel]) -> OnRestart | None:
    """What a continued run may do with a key of a model's tables: what is said of it, or of the tables it is in."""
    rule = None
    for depth, key in enumerate(place):
        section = section_at(place[:depth], data, model) if isinstance(key, str) else None
        rule = (section.rule_on_restart(key) if section is not None else None) or rule
    return rule
