"""JSON Schema of scenes, with which editors complete and check TOML.

It knows every table, key, kind, bound and default; what depends on several keys at once only `parsolid check` tells.
"""

from typing import Any

from parsolid.commands.keys.description import Key, keys_of, meaning_of
from parsolid.scene.base_model import SceneModel
from parsolid.scene.schema import Scene

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def scene_schema() -> dict[str, Any]:
    """The schema of a scene, tables under "$defs"."""
    known: dict[type[SceneModel], str] = {}
    tables: dict[str, Any] = {}
    top = _table(Scene, known, tables)
    return {"$schema": DIALECT, "title": "A scene of parsolid", **top, "$defs": dict(sorted(tables.items()))}


def _table(model: type[SceneModel], known: dict[type[SceneModel], str], tables: dict[str, Any]) -> dict[str, Any]:
    keys = list(keys_of(model))
    needed: dict[str, Any] = {"required": [key.name for key in keys if key.default is None]}
    if any(key.name == "library" for key in keys):
        # a material of the library needs no other number
        needed = {"anyOf": [needed, {"required": ["library"]}]}
    return {
        "type": "object",
        "description": meaning_of(model),
        "properties": {key.name: _value(key, known, tables) for key in keys},
        **needed,
        "additionalProperties": False,
    }


def _reference(model: type[SceneModel], known: dict[type[SceneModel], str], tables: dict[str, Any]) -> dict[str, str]:
    """Where a table's schema stands, made when it is first asked for."""
    if model not in known:
        taken = set(known.values())
        names = [model.__name__, *(f"{model.__name__}{number}" for number in range(2, 100))]
        known[model] = next(name for name in names if name not in taken)
        tables[known[model]] = _table(model, known, tables)
    return {"$ref": f"#/$defs/{known[model]}"}


def _value(key: Key, known: dict[type[SceneModel], str], tables: dict[str, Any]) -> dict[str, Any]:
    made = {
        word: part for word, part in key.value.schema.items() if word not in ("type", "items") or not key.value.tables
    }
    if key.value.tables:
        choices: list[dict[str, Any]] = [_reference(model, known, tables) for model in key.value.tables.values()]
        # a law of one's own is a file, of which only its own text says what it takes
        if len(choices) > 1 and key.name in _OWN_LAWS:
            choices.append({"type": "object", "required": ["law"], "properties": {"law": {"type": "string"}}})
        if "boolean" in key.value.schema.get("type", ()):
            choices.append({"const": False})
        one = choices[0] if len(choices) == 1 else {"anyOf": choices}
        made |= {"type": "array", "items": one} if key.value.listed else one
    if key.meaning:
        made["description"] = key.meaning
    return made


# keys of tables that may be a law of a file
_OWN_LAWS = ("material", "flow_stress", "shear_modulus", "equation_of_state", "melting")
