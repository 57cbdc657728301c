"""JSON Schema of scenes, with which editors complete and check TOML.

It knows every table, key, kind, bound and default, and keys that exclude each other; the rest `parsolid check` tells.
"""

from math import inf
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from parsolid.scene.base_model import SceneModel
from parsolid.scene.schema import Scene


class _OfToml(GenerateJsonSchema):
    """TOML has no null, scenes no infinite numbers, and keys need no titles besides their names."""

    def nullable_schema(self, schema: Any) -> Any:
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: Any) -> Any:
        made = super().default_schema(schema)
        if made.get("default", "") in (None, inf):
            del made["default"]
        return made

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def schema_of(model: type[SceneModel]) -> dict[str, Any]:
    """The schema of a model's table, those within under "$defs"."""
    return model.model_json_schema(schema_generator=_OfToml)


def scene_schema() -> dict[str, Any]:
    """The schema of a scene."""
    return {"$schema": _OfToml.schema_dialect, **schema_of(Scene), "title": "A scene of parsolid"}
