"""What keys a scene may have, read from the JSON Schema of the models that check it."""

from dataclasses import dataclass
from math import inf
from typing import Any

from pydantic.json_schema import GenerateJsonSchema

from parsolid.scene.base_model import SceneModel
from parsolid.scene.raw_tables import toml_value
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


_WORDS = {"number": "a number", "integer": "a whole number", "boolean": "true or false", "string": "a text"}
_BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
_LENGTHS = {"minItems": "at least", "maxItems": "at most"}


@dataclass(frozen=True)
class Key:
    """One key of a table: its name, what it takes in words, its tables by kind ("" where there is one without kinds),
    its default as TOML (None: it must be given), what it means."""

    name: str
    words: str
    tables: "dict[str, Table]"
    default: str | None
    meaning: str


@dataclass(frozen=True)
class Table:
    """A table: its schema, and the schemas of all tables by the names with which they refer to each other."""

    schema: dict[str, Any]
    known: dict[str, Any]

    @classmethod
    def of(cls, model: type[SceneModel]) -> "Table":
        """The table of a model."""
        schema = schema_of(model)
        return cls(schema, schema.get("$defs", {}))

    @property
    def meaning(self) -> str:
        """What it is."""
        return str(self.schema.get("description", ""))

    @property
    def needed(self) -> list[str]:
        """The keys that it must have."""
        # what a library has need not be given
        of_library = [rule["anyOf"][0] for rule in self.schema.get("allOf", ()) if "anyOf" in rule]
        return [key for part in (self.schema, *of_library) for key in part.get("required", ())]

    @property
    def keys(self) -> dict[str, Key]:
        """Its keys in the order in which they are declared."""
        return {name: self._key(name, schema) for name, schema in self.schema.get("properties", {}).items()}

    def _key(self, name: str, schema: dict[str, Any]) -> Key:
        # of several tables without kinds the first: others are short for it
        tables: dict[str, Table] = {}
        for kind, table in self._tables(schema):
            tables.setdefault(kind, table)
        meaning = schema.get("description", "")
        if not meaning and (name == "kind" or len(tables) == 1):
            meaning = self.meaning if name == "kind" else next(iter(tables.values())).meaning
        default = None if name in self.needed else _default(schema.get("default"))
        return Key(name, self._words(schema), tables, default, meaning)

    def _tables(self, schema: dict[str, Any]) -> "list[tuple[str, Table]]":
        """Kinds and tables that a key of a schema takes, one at a time or in a list."""
        if "$ref" in schema:
            table = Table(self.known[schema["$ref"].rpartition("/")[2]], self.known)
            kind = table.schema.get("properties", {}).get("kind", {})
            kinds = kind.get("enum", [kind.get("const")]) if "kind" in table.needed else [""]
            return [(name, table) for name in kinds]
        parts = [schema["items"]] if "items" in schema else schema.get("anyOf", schema.get("oneOf", ()))
        return [found for part in parts for found in self._tables(part)]

    def _words(self, schema: dict[str, Any]) -> str:
        """What a schema takes."""
        if "$ref" in schema or "properties" in schema:
            return "a table"
        if "title" in schema:
            return str(schema["title"])
        if choices := schema.get("anyOf", schema.get("oneOf")):
            return " or ".join(dict.fromkeys(map(self._words, choices)))
        if "enum" in schema or "const" in schema:
            return " or ".join(dict.fromkeys(map(toml_value, schema.get("enum", [schema.get("const")]))))
        if schema.get("type") == "array":
            lengths = [f"{words} {schema[key]}" for key, words in _LENGTHS.items() if key in schema]
            many = self._words(schema["items"]).removeprefix("a ")
            return f"a list ({', '.join(lengths)}) of: {many}" if lengths else f"a list of: {many}"
        if schema.get("type") == "object":
            return f"a table of {self._words(schema['additionalProperties']).removeprefix('a ')}s"
        bounds = [f"{sign} {schema[key]:g}" for key, sign in _BOUNDS.items() if key in schema]
        return " ".join([_WORDS.get(schema.get("type", ""), "any value"), " and ".join(bounds)]).strip()


def _default(value: Any) -> str:
    """A default as a scene would state it, in words where it would not."""
    if value is None:
        return "none"
    return "as its keys" if isinstance(value, dict) and value else toml_value(value)
