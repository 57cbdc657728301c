"""What all tables of a scene share: strictness, exclusive keys, a kind that chooses the model, points and planes."""

from collections.abc import Mapping
from enum import StrEnum
from math import isfinite
from typing import Annotated, Any, ClassVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from parsolid.materials.declaration import Phrase
from parsolid.scene.renamed import RENAMED
from parsolid.scene.validation_errors import NOTHING, describe, suggestion

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


def mismatch(expected: str, found: object, code: str = "refused") -> PydanticCustomError:
    """The error of a value that is not what its key wants; code: as of `Fault`."""
    words = describe(found)
    text = f"expected {expected}, found {words}"
    return PydanticCustomError("mismatch", "{text}", {"text": text, "expected": expected, "found": words, "code": code})


# place of a fault in the tables of a scene, what was expected, what was found; and a code where that is not "refused"
Detail = tuple[tuple[str | int, ...], str, object]
FaultDetail = Detail | tuple[tuple[str | int, ...], str, object, str]


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
    def rule_on_restart(cls, key: str) -> OnRestart | None:
        """What is said of a key, by this table or one that it is derived from."""
        owners = (vars(owner).get("on_restart", {}) for owner in cls.__mro__)
        return next((rules[key] for rules in owners if key in rules), None)

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
        """Report excluding keys together with the faults of the single keys, not after them."""
        conflicts = cls._conflicts(value) if isinstance(value, dict) else []
        try:
            result = handler(value)
        except ValidationError as error:
            if not conflicts:
                raise
            for found in error.errors(include_url=False):
                kind: Any = found["type"]
                if kind == "mismatch":
                    kind = PydanticCustomError("mismatch", "{text}", found["ctx"])
                conflicts.append(
                    InitErrorDetails(type=kind, loc=found["loc"], input=found["input"], ctx=found.get("ctx", {}))
                )
        if conflicts:
            raise ValidationError.from_exception_data(cls.__name__, conflicts)
        return result


class _Unknown(SceneModel):
    kind: str = ""


# stands where a method or a material is at fault, so that the other tables can be judged
UNKNOWN = _Unknown()


def kinds_of(model: type[SceneModel]) -> tuple[str, ...]:
    """What the key `kind` of a model's table may be."""
    return get_args(model.model_fields["kind"].annotation)


class ByKind:
    """Annotation of a field whose table's `kind` chooses one of several models.

    models: those, or them by kind; known: the attribute of a method's settings that lists the kinds which the method
    knows, "" where all will do.
    """

    def __init__(
        self,
        models: "tuple[type[SceneModel], ...] | Mapping[str, type[SceneModel]]",
        known: str = "",
    ) -> None:
        self.known = known
        by_kind = models if isinstance(models, Mapping) else {kind: one for one in models for kind in kinds_of(one)}
        self.models: Any = by_kind

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.with_info_plain_validator_function(self._validate)

    @property
    def instances(self) -> tuple[type, ...]:
        """What needs no validation any more."""
        return tuple(self.models.values())

    def tables(self) -> dict[str, type[SceneModel]]:
        """Every kind and its model, of any method."""
        return dict(self.models)

    def allowed(self, info: ValidationInfo, table: object = None) -> list[str]:
        """Kinds that the scene's method knows, or that of the body which a raw table names, in the method's order."""
        method = method_of(info, table)
        stated = getattr(method, self.known) if self.known and method else self.models
        return [kind for kind in stated if kind in self.models]

    def _validate(self, value: Any, info: ValidationInfo) -> Any:
        # a raw table first: asking what else there may be imports all models
        if not isinstance(value, dict) and (value is UNKNOWN or isinstance(value, self.instances)):
            return value
        if not isinstance(value, dict):
            raise mismatch("a table", value, "type")
        result: SceneModel = self.chosen(value, info).model_validate(value, context=info.context)
        return result

    def chosen(self, value: dict[str, Any], info: ValidationInfo) -> type[SceneModel]:
        """The model for a raw table; raises ValidationError where it names none."""
        model = self.choose(value)
        if model is not None and not self.known:
            return model
        allowed = self.allowed(info, value)
        kinds = ", ".join(map(repr, allowed))
        if "kind" not in value:
            reject((("kind",), f"one of {kinds}", NOTHING), code="missing")
        if model is None:
            # an old word's new one, whether or not this method knows it
            near = suggestion(value["kind"], self.models if str(value["kind"]) in RENAMED else allowed)
            reject((("kind",), f"one of {kinds}{near}", value["kind"]), code="choice")
        if value["kind"] not in allowed:
            whose = "of the body" if (info.context or {}).get("methods") else "of the scene"
            why = getattr(method_of(info, value), "refused", {}).get(value["kind"])
            reason = f" ({value['kind']}: {why})" if why and self.known == "boundaries" else ""
            reject((("kind",), f"one of {kinds}, which the method {whose} knows{reason}", value["kind"]), code="method")
        assert model is not None
        return model

    def choose(self, table: object) -> type[SceneModel] | None:
        """The model for a table's kind, None when there is no such kind."""
        kind = table.get("kind") if isinstance(table, dict) else None
        found: type[SceneModel] | None = self.models.get(kind) if isinstance(kind, str) else None
        return found


class TableOr:
    """The type of a field that holds a model, or one value that stands for none."""

    def __init__(self, model: type[SceneModel], none: object) -> None:
        self.model, self.none = model, none

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.with_info_plain_validator_function(self._validate)

    def _validate(self, value: Any, info: ValidationInfo) -> Any:
        if value is self.none or isinstance(value, self.model):
            return value
        if not isinstance(value, dict):
            raise mismatch(f"a table or {describe(self.none).lower()}", value)
        return self.model.model_validate(value, context=info.context)


def by_kind(*models: type[SceneModel], known: str = "") -> Any:
    """The type of a field that holds one of the models; each has a literal field `kind`; known as in `ByKind`."""
    return Annotated[Any, ByKind(models, known)]


def _components(value: list[Any], info: ValidationInfo) -> list[Any]:
    dimension = dimension_of(info)
    if dimension is not None and len(value) != dimension:
        raise mismatch(f"{dimension} components (one per dimension)", value, "length")
    return value


OnePerDimension = AfterValidator(_components)
Point = Annotated[list[float], OnePerDimension]


class Plane:
    """An axis-aligned plane, "Y = 0": `axis` (0, 1, 2) and `offset` [m]."""

    def __init__(self, axis: int, offset: float) -> None:
        self.axis = axis
        self.offset = offset

    def __str__(self) -> str:
        return f"{AXES[self.axis]} = {self.offset!r}"

    def __repr__(self) -> str:
        return f"Plane({str(self)!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Plane) and (self.axis, self.offset) == (other.axis, other.offset)

    def __hash__(self) -> int:
        return hash((self.axis, self.offset))

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
