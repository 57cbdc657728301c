"""Base of all tables of a scene: strict models, exclusive keys, tables chosen by `kind`, points and planes, faults."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations, pairwise
from math import isfinite
from typing import Annotated, Any, ClassVar, get_args

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from parsolid.materials.declaration import Phrase
from parsolid.scene.validation_errors import NOTHING, Fault, describe, key_path, suggestion

AXES = ("X", "Y", "Z")

# smallest and largest absolute value of a number: products of five neither overflow nor underflow
LEAST, MOST = 1e-60, 1e60


class OnRestart(StrEnum):
    """Rule for a key whose value differs from that of the checkpoint of a continued run.

    FREE: it may change, with a note; SILENT: it may change without a note; FIXED: it may not change. A key without a
    rule may change if the user allows it. The rule of a table holds for its keys that have none.
    """

    FREE = "free"
    SILENT = "silent"
    FIXED = "fixed"


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Name = Annotated[str, Field(pattern=r"^[^.,\s][^.,]*$", description="a name without '.' and ','")]


_MESSAGE = "expected {expected}, found {found}{suggestion}"


def mismatch(
    expected: str, found: object, code: str = "refused", near: str = "", bounds: dict[str, Any] | None = None
) -> PydanticCustomError:
    """The error of a value that its key does not accept.

    code: of the `Fault`; near: a suggestion; bounds: those of a number that is outside of them
    """
    parts = {"expected": expected, "found": describe(found), "code": code, "suggestion": near}
    return PydanticCustomError("mismatch", _MESSAGE, (bounds or {}) | parts)


# location of a fault in the tables of a scene, expected, found, and a code if it is not "refused"
Detail = tuple[tuple[str | int, ...], str, object]
FaultDetail = Detail | tuple[tuple[str | int, ...], str, object, str]


def reject(*details: FaultDetail) -> None:
    """Raise all details as one ValidationError; without any, do nothing."""
    if details:
        raise ValidationError.from_exception_data(
            "scene",
            [InitErrorDetails(type=mismatch(one[1], one[2], *one[3:]), loc=one[0], input=one[2]) for one in details],
        )


def dimension_of(info: ValidationInfo) -> int | None:
    """The dimension of the scene that is validated; None if it is not known."""
    return (info.context or {}).get("dimension")


def is_within(place: tuple[Any, ...], tables: Iterable[tuple[Any, ...]]) -> bool:
    """Whether a location is in one of the tables, or is one of them."""
    return any(place[: len(one)] == one for one in tables)


class SceneModel(BaseModel):
    """A table of a scene, immutable; unknown keys and implicit conversions are refused.

    exactly_one, at_most_one: groups of keys that exclude each other; only_with: pairs of a key and another one that it
    needs; on_restart: rules of keys.
    """

    # defer_build: a scene uses a dozen of the seventy tables
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)
    exactly_one: ClassVar[tuple[tuple[str, ...], ...]] = ()
    at_most_one: ClassVar[tuple[tuple[str, ...], ...]] = ()
    only_with: ClassVar[tuple[tuple[str, str], ...]] = ()
    on_restart: ClassVar[dict[str, OnRestart]] = {}

    @classmethod
    def _conflicts(cls, table: dict[str, Any]) -> list[InitErrorDetails]:
        details: list[Any] = []
        for group in cls.exactly_one + cls.at_most_one:
            present = [key for key in group if table.get(key) is not None]
            required = group in cls.exactly_one
            if len(present) > 1 or (required and not present):
                count = "exactly one of" if required else "at most one of"
                found = " and ".join(present) if present else "none"
                error = mismatch(f"{count} {', '.join(group)}", Phrase(found), "exclusive")
                details.append(InitErrorDetails(type=error, loc=(), input=table))
        for key, needed in cls.only_with:
            if table.get(key) is not None and table.get(needed) is None:
                error = mismatch(f"no such key without {needed}", table[key])
                details.append(InitErrorDetails(type=error, loc=(key,), input=table))
        return details

    @model_validator(mode="wrap")
    @classmethod
    def _every_fault(cls, value: Any, handler: Any) -> "SceneModel":
        """Report faults of single keys and of exclusive keys together, in the words of this package."""
        conflicts = cls._conflicts(value) if isinstance(value, dict) else []
        try:
            result = handler(value)
        except ValidationError as error:
            conflicts += faults_in_words(cls, error.errors(include_url=False), value)
        if conflicts:
            raise ValidationError.from_exception_data(cls.__name__, conflicts)
        return result

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        made: dict[str, Any] = handler.resolve_ref_schema(handler(schema))
        made["description"] = " ".join((cls.__doc__ or "").split("\n\n")[0].split())
        for name, key in made.get("properties", {}).items():
            # a field that overrides a default keeps the description of the base class
            fields = (owner.model_fields.get(name) for owner in cls.__mro__ if issubclass(owner, SceneModel))
            if meaning := next((one.description for one in fields if one is not None and one.description), None):
                key.setdefault("description", meaning)
        rules: list[dict[str, Any]] = [{"oneOf": [{"required": [key]} for key in group]} for group in cls.exactly_one]
        for group in cls.at_most_one:
            rules += [{"not": {"required": list(pair)}} for pair in combinations(group, 2)]
        if "library" in cls.model_fields:
            # an entry of a library gives all required keys
            rules = [{"anyOf": [{"required": made.pop("required", [])}, {"required": ["kind", "library"]}]}]
        if rules:
            made["allOf"] = rules
        return made


def kinds_of(model: type[SceneModel]) -> tuple[str, ...]:
    """The values of the key `kind` of a model's table."""
    return get_args(model.model_fields["kind"].annotation)


def tables_of(annotation: Any) -> dict[str, type[SceneModel]]:
    """Models of the tables that a type accepts, by `kind`; "" for a table without this key."""
    if isinstance(annotation, FieldInfo):
        annotation = annotation.annotation
    if isinstance(annotation, type) and issubclass(annotation, SceneModel):
        has_kind = "kind" in annotation.model_fields and annotation.model_fields["kind"].is_required()
        return dict.fromkeys(kinds_of(annotation) if has_kind else ("",), annotation)
    return {kind: model for part in get_args(annotation) for kind, model in tables_of(part).items()}


# type of an error of pydantic -> expected, and the code of the fault
_EXPECTED = {
    "float_type": ("a number", "type"),
    "int_type": ("a whole number", "type"),
    "int_from_float": ("a whole number", "type"),
    "string_type": ("a text", "type"),
    "bool_type": ("true or false", "type"),
    "list_type": ("a list", "type"),
    "dict_type": ("a table", "type"),
    "model_type": ("a table", "type"),
    "model_attributes_type": ("a table", "type"),
    "finite_number": ("a finite number", "bound"),
    "greater_than": ("a number > {gt:g}", "bound"),
    "greater_than_equal": ("a number >= {ge:g}", "bound"),
    "less_than": ("a number < {lt:g}", "bound"),
    "less_than_equal": ("a number <= {le:g}", "bound"),
    "too_short": ("a list of at least {min_length}", "length"),
    "too_long": ("a list of at most {max_length}", "length"),
    "literal_error": ("{expected}", "choice"),
    "union_tag_invalid": ("one of {expected_tags}", "choice"),
}


def faults_in_words(model: type[SceneModel], errors: list[Any], table: Any) -> list[InitErrorDetails]:
    """Errors of pydantic in a raw table of a model as mismatches at locations of the table.

    For a key that accepts several types pydantic reports an error for each; they become one.
    """
    # location, and the number of the error unless it is that of one of several types -> mismatches
    groups: dict[tuple[Any, int | None], list[PydanticCustomError]] = {}
    for number, error in enumerate(errors):
        place, is_one_type = _place_in_table(error, table)
        found = _mismatch_of(model, error, place)
        place = (*place, "kind") if error["type"].startswith("union_tag") else place
        groups.setdefault((place, None if is_one_type else number), []).append(found)
    result = []
    for (place, _), alternatives in groups.items():
        contexts: list[dict[str, Any]] = [one.context or {} for one in alternatives]
        # an error of a bound is of the type that the value has
        main = next((one for one in contexts if one["code"] == "bound"), contexts[0])
        expected = " or ".join(dict.fromkeys(one["expected"] for one in contexts))
        merged = PydanticCustomError("mismatch", _MESSAGE, main | {"expected": expected})
        result.append(InitErrorDetails(type=merged, loc=place, input=value_at(table, place)))
    return result


def _place_in_table(error: Any, table: Any) -> tuple[tuple[Any, ...], bool]:
    """The location of an error of pydantic in a raw table, and whether the error is that of one of several types.

    pydantic inserts the kind of a table where `kind` chooses its model, and appends the name of one of several types.
    """
    place: tuple[Any, ...] = error["loc"]
    for depth in range(1, len(place)):
        inner = value_at(table, place[:depth])
        if isinstance(inner, dict) and inner.get("kind") == place[depth]:
            place = place[:depth] + place[depth + 1 :]
            break
    if len(place) > 1 and error["type"] not in ("mismatch", "missing"):
        inner = value_at(table, place[:-1])
        if not (place[-1] in inner if isinstance(inner, dict) else isinstance(place[-1], int)):
            return place[:-1], True
    return place, False


def _mismatch_of(model: type[SceneModel], error: Any, place: tuple[Any, ...]) -> PydanticCustomError:
    """An error of pydantic at a location in a table of a model, with expected, found and code."""
    kind, found, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "mismatch":
        # of a table within the table, or of a validator of this package
        return PydanticCustomError(kind, _MESSAGE, context)
    field = model.model_fields.get(place[0]) if place else None
    meaning = field.description if field is not None and len(place) == 1 else None
    if kind == "extra_forbidden":
        known, words = model.model_fields, Phrase(f"the unknown key {place[-1]!r}")
        return mismatch(f"one of {', '.join(known)}", words, "unknown-key", suggestion(place[-1], known))
    if kind == "missing":
        return mismatch(meaning or "a value", NOTHING, "missing")
    if kind == "union_tag_not_found":
        return mismatch(f"one of {', '.join(map(repr, tables_of(field)))}", NOTHING, "missing")
    if kind not in _EXPECTED:
        return mismatch(meaning or error["msg"], found)
    template, code = _EXPECTED[kind]
    expected = template.format(**context)
    if code == "choice":
        found = found["kind"] if kind == "union_tag_invalid" else found
        expected += suggestion(found, re.findall("'([^']*)'", expected))
    return mismatch(expected, found, code, bounds=context)


def value_at(tables: Any, place: Iterable[Any]) -> Any:
    """The value at a location in raw tables and lists; None if there is no such location."""
    for key in place:
        try:
            tables = tables[key]
        except (LookupError, TypeError):
            return None
    return tables


def _components(value: list[Any], info: ValidationInfo) -> list[Any]:
    dimension = dimension_of(info)
    if dimension is not None and len(value) != dimension:
        raise mismatch(f"{dimension} components (one per dimension)", value, "length")
    return value


OnePerDimension = AfterValidator(_components)
Point = Annotated[list[float], OnePerDimension]


def _not_zero(value: list[float]) -> list[float]:
    if not any(value):
        raise mismatch("a direction that is not zero", value)
    return value


def _rising(times: list[float]) -> list[float]:
    late = [(i, after) for i, (before, after) in enumerate(pairwise(times), 1) if after <= before]
    reject(*(((i,), "a time later than the one before", time) for i, time in late))
    return times


def _as_list(value: Any) -> Any:
    return [float(value)] if isinstance(value, int | float) and not isinstance(value, bool) else value


Direction = Annotated[Point, AfterValidator(_not_zero)]
Times = Annotated[list[NotNegative], AfterValidator(_rising)]
# accepts a number as a list of one
OneOrMore = BeforeValidator(_as_list, json_schema_input_type=float | list[float])


@dataclass(frozen=True)
class Plane:
    """An axis-aligned plane, "Y = 0": `axis` (0, 1, 2) and `offset` [m]."""

    axis: int
    offset: float

    def __str__(self) -> str:
        return f"{AXES[self.axis]} = {self.offset!r}"

    def height(self, places: np.ndarray) -> np.ndarray:
        """Signed distances (n,) [m] of points (n, d), positive in the direction of its axis."""
        return np.asarray(places[:, self.axis] - self.offset)

    @classmethod
    def parse(cls, text: object, dimension: int | None = 3) -> "Plane":
        """The plane that `text` names; raises PydanticCustomError if it names none of this dimension."""
        axes = AXES[: dimension or 3]
        expected = f"a plane such as 'Y = 0' with one of the axes {', '.join(axes)}"
        name, equals, number = text.partition("=") if isinstance(text, str) else ("", "", "")
        if name.strip() not in axes or not equals:
            raise mismatch(expected, text)
        try:
            offset = float(number)
        except ValueError:
            raise mismatch(expected, text) from None
        if not isfinite(offset):
            raise mismatch(expected, text)
        return cls(axes.index(name.strip()), offset)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        def validate(value: Any, info: Any) -> Any:
            return value if isinstance(value, cls) else cls.parse(value, dimension_of(info))

        return core_schema.with_info_plain_validator_function(
            validate, serialization=core_schema.plain_serializer_function_ser_schema(str)
        )

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> dict[str, Any]:
        return {"type": "string", "pattern": r"^\s*[XYZ]\s*=", "title": "a plane such as 'Y = 0'"}


def faults_of_errors(error: ValidationError) -> list[Fault]:
    """The faults of a ValidationError of a `SceneModel`."""
    return [fault_of_error(item, item["loc"]) for item in error.errors(include_url=False)]


def fault_of_error(error: Any, place: tuple[Any, ...]) -> Fault:
    """One of the errors of a ValidationError as a fault at a location."""
    parts = error["ctx"]
    return Fault(parts["code"], key_path(place), parts["expected"], parts["found"], parts["suggestion"])


def on_restart(place: tuple[Any, ...], data: Any, model: type[SceneModel]) -> OnRestart | None:
    """The restart rule of the key at a location in tables of a model: its own, or that of the innermost table."""
    rule: OnRestart | None = None
    section: type[SceneModel] | None = model
    tables: dict[str, type[SceneModel]] = {}
    for depth, key in enumerate(place):
        if isinstance(key, str):
            owners = [vars(owner).get("on_restart", {}) for owner in section.__mro__] if section is not None else []
            rule = next((rules[key] for rules in owners if key in rules), rule)
            tables = tables_of(section.model_fields[key]) if section is not None and key in section.model_fields else {}
        if depth < len(place) - 1:
            data = data[key]
            kind = data.get("kind") if isinstance(data, dict) else None
            section = tables.get("") or tables.get(str(kind))
    return rule
