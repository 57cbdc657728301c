"""What keys a scene may have, read from the models that check it."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from pydantic import PlainValidator
from pydantic.fields import FieldInfo

from parsolid.scene.base_model import ByKind, Plane, SceneModel, TableOr
from parsolid.scene.raw_tables import toml_value

_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text", dict: "a table of texts"}
_NAMES = {float: "number", int: "integer", bool: "boolean", str: "string", dict: "object"}
_BOUNDS = {Gt: (">", "exclusiveMinimum"), Ge: (">=", "minimum"), Lt: ("<", "exclusiveMaximum"), Le: ("<=", "maximum")}
_LENGTHS = {MinLen: ("at least", "minItems"), MaxLen: ("at most", "maxItems")}


@dataclass
class Value:
    """What a key takes: in words, as JSON Schema without the tables, and the models of its tables by kind."""

    words: str = "any value"
    schema: dict[str, Any] = field(default_factory=dict)
    tables: dict[str, type[SceneModel]] = field(default_factory=dict)
    listed: bool = False


@dataclass
class Key:
    """One key of a table: its name, what it takes, its default as TOML (None: it must be given), what it means."""

    name: str
    value: Value
    default: str | None
    meaning: str


def keys_of(model: type[SceneModel]) -> Iterator[Key]:
    """The keys of a table in the order in which they are declared."""
    for name, stated in model.model_fields.items():
        value = value_of(stated.annotation, stated.metadata)
        if isinstance(stated.json_schema_extra, dict) and "or" in stated.json_schema_extra:
            # what a validator makes into a list of one
            value.words = f"a {stated.json_schema_extra['or']} or {value.words}"
            value.schema = {"anyOf": [value.schema, {"type": stated.json_schema_extra["or"]}]}
        owners = [owner.model_fields for owner in model.__mro__ if issubclass(owner, SceneModel)]
        # where a table changes a default of its base, the meaning stays
        told = (fields[name].description for fields in owners if name in fields)
        meaning = next(filter(None, told), None) or _documented(model, name)
        if not meaning and name == "kind":
            meaning = meaning_of(model)
        if not meaning and len(value.tables) == 1:
            meaning = meaning_of(next(iter(value.tables.values())))
        yield Key(name, value, _default(stated), meaning)


def meaning_of(model: type[SceneModel]) -> str:
    """What a table is, the first sentences of its docstring."""
    return " ".join((model.__doc__ or "").split("\n\n")[0].split())


def value_of(annotation: Any, metadata: Any = ()) -> Value:
    """What a field of a type takes."""
    metadata = list(metadata)
    while get_origin(annotation) is Annotated:
        annotation, *more = get_args(annotation)
        metadata += [part for one in more for part in (one.metadata if isinstance(one, FieldInfo) else [one])]
    for one in metadata:
        if isinstance(one, ByKind):
            return Value("a table", {"type": "object"}, dict(one.tables()))
        if isinstance(one, TableOr):
            return Value("a table or false", {"type": ["object", "boolean"]}, {"": one.model})
        if isinstance(one, PlainValidator):
            return Value("a formula", {"type": ["string", "number"]})
    origin = get_origin(annotation)
    if origin is Union or origin is UnionType:
        parts = [value_of(part, metadata) for part in get_args(annotation) if part is not type(None)]
        return parts[0] if len(parts) == 1 else _either(parts)
    if origin in (list, tuple):
        return _list_of(get_args(annotation), metadata)
    if isinstance(annotation, type) and issubclass(annotation, SceneModel):
        return Value("a table", {"type": "object"}, {"": annotation})
    return _one_of(get_args(annotation)) if origin is Literal else _bounded(origin or annotation, metadata)


def _either(parts: list[Value]) -> Value:
    tables = {kind: model for part in parts for kind, model in part.tables.items()}
    return Value(" or ".join(part.words for part in parts), {"anyOf": [part.schema for part in parts]}, tables)


def _one_of(choices: tuple[Any, ...]) -> Value:
    return Value(" or ".join(dict.fromkeys(map(toml_value, choices))), {"enum": list(choices)})


def _list_of(parts: tuple[Any, ...], metadata: list[Any]) -> Value:
    inner = value_of(parts[0]) if parts else Value()
    schema: dict[str, Any] = {"type": "array", "items": inner.schema}
    said = []
    for one in metadata:
        if type(one) in _LENGTHS:
            word, name = _LENGTHS[type(one)]
            bound = getattr(one, "min_length" if word == "at least" else "max_length")
            schema[name] = bound
            said.append(f"{word} {bound}")
    many = re.sub(r"^(a|an) ", "", inner.words)
    words = f"a list ({', '.join(said)}) of: {many}" if said else f"a list of: {many}"
    return Value(words, schema, inner.tables, True)


def _bounded(kind: Any, metadata: list[Any]) -> Value:
    if kind is Plane:
        return Value("a plane such as 'Y = 0'", {"type": "string"})
    schema: dict[str, Any] = {"type": _NAMES[kind]} if kind in _NAMES else {}
    said = []
    for one in metadata:
        if type(one) in _BOUNDS:
            sign, name = _BOUNDS[type(one)]
            bound = getattr(one, type(one).__name__.lower())
            schema[name] = bound
            said.append(f"{sign} {bound:g}")
    return Value(" ".join([_WORDS.get(kind, "any value"), " and ".join(said)]).strip(), schema)


def _default(stated: FieldInfo) -> str | None:
    if stated.is_required():
        return None
    value = stated.get_default(call_default_factory=True)
    if isinstance(value, SceneModel):
        return "as its keys"
    return "none" if value is None else toml_value(value)


def _documented(model: type, name: str) -> str:
    """The meaning of a key in the table that the docstring of its class, or of a base, may hold."""
    for owner in model.__mro__:
        lines = (owner.__doc__ or "").splitlines()
        for number, line in enumerate(lines):
            found = re.match(rf"\s*{name}\s\s+(\S.*)", line)
            if found is None:
                continue
            words = [found[1]]
            for more in lines[number + 1 :]:
                if not re.match(r"\s{8,}\S", more):
                    break
                words.append(more.strip())
            return " ".join(words)
    return ""
