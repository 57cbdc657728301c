"""What pydantic finds wrong with the tables of a model, as faults; and what a restart may change of them."""

from typing import Any

from pydantic import ValidationError

from parsolid.scene.base_model import OnRestart, SceneModel, tables_of
from parsolid.scene.validation_errors import Fault, key_path


def faults_of_errors(error: ValidationError) -> list[Fault]:
    """The faults of the raw tables of a `SceneModel`."""
    return [fault_of_error(item, item["loc"]) for item in error.errors(include_url=False)]


def fault_of_error(error: Any, place: tuple[Any, ...]) -> Fault:
    """One of pydantic's errors as a fault at a place."""
    parts = error["ctx"]
    return Fault(parts["code"], key_path(place), parts["expected"], parts["found"], parts["suggestion"])


def on_restart(place: tuple[Any, ...], data: Any, model: type[SceneModel]) -> OnRestart | None:
    """What a continued run may do with a key of a model's tables: what is said of it, or of the tables it is in."""
    rule: OnRestart | None = None
    section: type[SceneModel] | None = model
    tables: dict[str, type[SceneModel]] = {}
    for depth, key in enumerate(place):
        if isinstance(key, str):
            rule = (section.rule_on_restart(key) if section is not None else None) or rule
            tables = tables_of(section.model_fields[key]) if section is not None and key in section.model_fields else {}
        if depth < len(place) - 1:
            data = data[key]
            kind = data.get("kind") if isinstance(data, dict) else None
            section = tables.get("") or tables.get(str(kind))
    return rule
