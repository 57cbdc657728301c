"""What all tables of a scene share: strictness, exclusive keys, a kind that chooses the model, points and planes."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations, groupby, pairwise
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
from parsolid.scene.validation_errors import NOTHING, RENAMED, Fault, describe, key_path, suggestion

AXES = ("X", "Y", "Z")

# sizes of numbers of which products of five are within what floating-point numbers hold
LEAST, MOST = 1e-60, 1e60


class OnRestart(StrEnum):
    """What a continued run may do with a key whose value in the scene is not that of the checkpoint.

    FREE: change it, and a note says so; SILENT: change it without a note; FIXED: it may not. A key without a rule may
    change where the user allows it. The rule of a table holds for those of its keys that have none.
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
    """The error of a value that is not what its key wants; code: as of `Fault`; near: a suggestion; bounds: of a number
    that is beyond one."""
    parts = {"expected": expected, "found": describe(found), "code": code, "suggestion": near}
    return PydanticCustomError("mismatch", _MESSAGE, (bounds or {}) | parts)


# place of a fault in the tables of a scene, what was expected, what was found; and a code where that is not "refused"
Detail = tuple[tuple[str | int, ...], str, object]
FaultDetail = Detail | tuple[tuple[str | int, ...], str, object, str]


def unknown_body(place: tuple[str | int, ...], name: str, names: Iterable[str | None]) -> FaultDetail:
    """The fault of a name that none of the bodies has."""
    return place, f"the name of a body{suggestion(name, [one for one in names if one])}", name, "unknown-name"


def reject(*details: tuple[tuple[Any, ...], str, object], code: str = "refused") -> None:
    """Raise the given (location, expected, found) as one validation error; nothing when there are none."""
    if details:
        raise ValidationError.from_exception_data(
            "scene",
            [
                InitErrorDetails(type=mismatch(expected, found, code), loc=place, input=found)
                for place, expected, found in details
            ],
        )


def dimension_of(info: ValidationInfo) -> int | None:
    """The scene's dimension while it is validated; None where it is not known (or itself at fault)."""
    return (info.context or {}).get("dimension")


def method_of(info: ValidationInfo, table: object = None) -> type | None:
    """The class of the scene's method while the scene is validated; None where it is not known (or itself at fault).

    Of several methods it is what they know together; table: a raw one that may name its body, whose method it then is.
    """
    context = info.context or {}
    of_body: dict[str, type | None] = context.get("method_of_body", {})
    name = table.get("body") if isinstance(table, dict) else None
    return of_body[name] if isinstance(name, str) and name in of_body else context.get("method")


class SceneModel(BaseModel):
    """A table of a scene: unknown keys and implicit conversions are refused, and it cannot be changed.

    `exactly_one` and `at_most_one` name groups of keys that exclude each other; on_restart: rules of its keys.
    """

    # built where a scene has such a table: most have a dozen of the seventy
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)
    exactly_one: ClassVar[tuple[tuple[str, ...], ...]] = ()
    at_most_one: ClassVar[tuple[tuple[str, ...], ...]] = ()
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
        return details

    @model_validator(mode="wrap")
    @classmethod
    def _every_fault(cls, value: Any, handler: Any) -> "SceneModel":
        """Report excluding keys together with the faults of the single keys, not after them; in the project's words."""
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
            # where a table changes a default of its base, the meaning stays
            fields = (owner.model_fields.get(name) for owner in cls.__mro__ if issubclass(owner, SceneModel))
            if meaning := next((one.description for one in fields if one is not None and one.description), None):
                key.setdefault("description", meaning)
        # which keys are there, in place of a list of those that are needed
        rules: list[dict[str, Any]] = [{"oneOf": [{"required": [key]} for key in group]} for group in cls.exactly_one]
        for group in cls.at_most_one:
            rules += [{"not": {"required": list(pair)}} for pair in combinations(group, 2)]
        if "library" in cls.model_fields:
            # an entry of a library has all that is needed
            rules = [{"anyOf": [{"required": made.pop("required", [])}, {"required": ["kind", "library"]}]}]
        return made | ({"allOf": rules} if rules else {})


def kinds_of(model: type[SceneModel]) -> tuple[str, ...]:
    """What the key `kind` of a model's table may be."""
    return get_args(model.model_fields["kind"].annotation)


def tables_of(annotation: Any) -> dict[str, type[SceneModel]]:
    """Models of the tables that a type takes, by the kind that each has to name, "" of one that has none."""
    if isinstance(annotation, FieldInfo):
        annotation = annotation.annotation
    if isinstance(annotation, type) and issubclass(annotation, SceneModel):
        told_apart = "kind" in annotation.model_fields and annotation.model_fields["kind"].is_required()
        return dict.fromkeys(kinds_of(annotation) if told_apart else ("",), annotation)
    return {kind: model for part in get_args(annotation) for kind, model in tables_of(part).items()}


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
    """Errors of pydantic in a raw table of a model, as `in_words`; one for a key that may have values of several types,
    of which pydantic tells each."""
    result: list[InitErrorDetails] = []
    for key, found in groupby(errors, lambda error: _key_of_alternative(error, table)):
        told = [in_words(model, error, table) for error in found]
        if key is not None:
            parts: list[Any] = [one["type"].context for one in told]  # type: ignore[union-attr]
            # a bound is that of the type which the value has
            told_by = next((one for one in parts if one["code"] == "bound"), parts[0])
            expected = " or ".join(dict.fromkeys(one["expected"] for one in parts))
            error = mismatch(expected, told[0]["input"], told_by["code"], bounds=told_by)
            told = [InitErrorDetails(type=error, loc=key, input=told[0]["input"])]
        result += told
    return result


def _key_of_alternative(error: Any, table: Any) -> tuple[Any, ...] | None:
    """The place in a raw table of the key whose value an error refuses for one of its types, which pydantic appends to
    the place; None of other errors."""
    *place, last = error["loc"] or (None,)
    if error["type"] in ("mismatch", "missing") or not place:
        return None
    try:
        for key in place:
            table = table[key]
    except (LookupError, TypeError):
        return None
    stated = last in table if isinstance(table, dict) else isinstance(last, int)
    return None if stated else tuple(place)


def in_words(model: type[SceneModel], error: Any, table: Any) -> InitErrorDetails:
    """An error of pydantic in a raw table of a model, with what was expected and found in place of pydantic's words."""
    place, kind, found, context = error["loc"], error["type"], error["input"], error.get("ctx", {})
    field = model.model_fields.get(place[0]) if place else None
    kinds = tables_of(field) if field is not None else {}
    place = _without_kind(place, table) if kinds.keys() - {""} else place
    if kind == "mismatch":
        return InitErrorDetails(type=PydanticCustomError(kind, _MESSAGE, context), loc=place, input=found)
    description = field.description if field is not None and len(place) == 1 else None
    expected, code, near, words = description or error["msg"], "refused", "", found
    if kind == "extra_forbidden":
        words, near = Phrase(f"the unknown key {place[-1]!r}"), suggestion(place[-1], model.model_fields)
        expected, code = f"one of {', '.join(model.model_fields)}", "unknown-key"
    elif kind == "missing":
        expected, code, words = description or "a value", "missing", NOTHING
    elif kind == "union_tag_not_found":
        expected, code, words = f"one of {', '.join(map(repr, kinds))}", "missing", NOTHING
    elif kind in _EXPECTED:
        template, code = _EXPECTED[kind]
        expected = template.format(**context)
    if kind == "union_tag_invalid":
        words = found["kind"]
        expected += suggestion(words, kinds)
    elif kind == "literal_error":
        expected += suggestion(found, [word.strip("' ") for word in expected.replace(" or ", ",").split(",")])
    place = (*place, "kind") if kind.startswith("union_tag") else place
    return InitErrorDetails(type=mismatch(expected, words, code, near, context), loc=place, input=found)


def _without_kind(place: tuple[Any, ...], table: Any) -> tuple[Any, ...]:
    """A place in tables without the kind by which pydantic chose a model for one of them."""
    depth = next((i for i, key in enumerate(place[1:], 1) if isinstance(key, str)), len(place))
    try:
        for key in place[:depth]:
            table = table[key]
    except (LookupError, TypeError):
        # not what the file states
        return place
    named = depth < len(place) and isinstance(table, dict) and table.get("kind") == place[depth]
    return place[:depth] + place[depth + 1 :] if named else place


def check_kind(
    table: Any, info: ValidationInfo, kinds: Collection[str], of_method: Collection[str], why: str = ""
) -> None:
    """Refuse a raw table of a kind that is none of those there are, or of the scene's method, or that of the body which
    the table names; why: the method's reason."""
    if not isinstance(table, dict) or table.get("kind") in list(of_method):
        return
    stated, known = table.get("kind", NOTHING), ", ".join(map(repr, of_method))
    if stated is NOTHING:
        reject((("kind",), f"one of {known}", NOTHING), code="missing")
    if stated not in list(kinds):
        # an old word's new one, whether or not this method knows it
        near = suggestion(stated, kinds if str(stated) in RENAMED else of_method)
        reject((("kind",), f"one of {known}{near}", stated), code="choice")
    whose = "of the body" if (info.context or {}).get("methods") else "of the scene"
    reason = f" ({stated}: {why})" if why else ""
    reject((("kind",), f"one of {known}, which the method {whose} knows{reason}", stated), code="method")


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
# what takes one number for a list of one
OneOrMore = BeforeValidator(_as_list, json_schema_input_type=float | list[float])


@dataclass(frozen=True)
class Plane:
    """An axis-aligned plane, "Y = 0": `axis` (0, 1, 2) and `offset` [m]."""

    axis: int
    offset: float

    def __str__(self) -> str:
        return f"{AXES[self.axis]} = {self.offset!r}"

    def height(self, places: np.ndarray) -> np.ndarray:
        """Distances (n,) [m] of places (n, d), positive beyond it along its axis."""
        return np.asarray(places[:, self.axis] - self.offset)

    @classmethod
    def parse(cls, text: object, dimension: int | None = 3) -> "Plane":
        """The plane that `text` names; raises PydanticCustomError when it names none of this dimension."""
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
            # said by the table or one that it is derived from
            owners = [vars(owner).get("on_restart", {}) for owner in section.__mro__] if section is not None else []
            rule = next((rules[key] for rules in owners if key in rules), rule)
            tables = tables_of(section.model_fields[key]) if section is not None and key in section.model_fields else {}
        if depth < len(place) - 1:
            data = data[key]
            kind = data.get("kind") if isinstance(data, dict) else None
            section = tables.get("") or tables.get(str(kind))
    return rule
