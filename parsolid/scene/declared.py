"""Tables of laws, made from the parameters that the laws declare (`materials.declaration`)."""

import os
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from math import inf
from pathlib import Path
from types import FunctionType
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin

import numpy as np
from pydantic import (
    Field,
    PlainSerializer,
    PlainValidator,
    ValidationInfo,
    WithJsonSchema,
    create_model,
    model_validator,
)
from pydantic_core import core_schema

from parsolid.materials import registry
from parsolid.materials.declaration import (
    NEEDED,
    BandWidth,
    Declared,
    Direction,
    OfMaterial,
    OfParticle,
    Parameter,
    StateVariable,
    built,
    parameters_of,
)
from parsolid.materials.registry import LawError
from parsolid.scene.base_model import SceneModel, reject
from parsolid.scene.formulas import InitialDirection, InitialScalar, formula_of_place
from parsolid.scene.validation_errors import suggestion


class OfCells(SceneModel):
    """Values of the elements of the body's mesh, from the mesh file."""

    cell_data: Annotated[str, Field(min_length=1)] = Field(description="the name of the data in the mesh file")


class StatedDirection(SceneModel):
    """A direction at each particle, of any length."""

    exactly_one: ClassVar = (("angle", "vector", "cell_data"),)
    angle: InitialScalar | None = Field(None, description="angle [rad] from X to Y, a formula of the reference place")
    vector: InitialDirection | None = Field(None, description="components, formulas of the reference place")
    cell_data: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="the name of a vector that elements have in the mesh file of the body"
    )

    def evaluate(self, points: np.ndarray) -> np.ndarray:
        """Vectors (n, 3) of any length at points (n, d) [m], from `angle` or `vector`."""
        result = np.zeros((len(points), 3))
        if self.angle is not None:
            angle = self.angle.evaluate(points)
            result[:, 0], result[:, 1] = np.cos(angle), np.sin(angle)
        else:
            assert self.vector is not None
            result[:, : len(self.vector)] = self.vector.evaluate(points)
        return result


def _number(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, OfCells):
        return value
    if isinstance(value, dict):
        return OfCells.model_validate(value, context=info.context)
    return formula_of_place(value, info)


# a formula, or a table with `cell_data`
_NUMBER = WithJsonSchema({"type": ["string", "number", "object"], "title": "a formula or cell_data"}, mode="validation")
StatedNumber: Any = Annotated[
    Any,
    PlainValidator(_number),
    PlainSerializer(lambda value: value.model_dump() if isinstance(value, OfCells) else value.source),
    _NUMBER,
]


def field_of_particles(note: Any) -> tuple[Any, Any]:
    """Type and field of a table for a member of a law that differs between particles, but for state variables."""
    meaning = f"{note.description} [{note.unit}]" if note.unit != "1" else note.description
    if isinstance(note, Direction):
        needed: dict[str, Any] = {} if note.needed else {"default": None}
        kind = StatedDirection if note.needed else StatedDirection | None
        description = f"a table: angle, vector or cell_data; the direction {meaning}".strip()
        return kind, Field(**needed, description=description)
    if isinstance(note, BandWidth):
        return StatedNumber | None, Field(None, description=f"width of the band of {meaning}")
    return StatedNumber, Field(description=meaning or None)


class DeclaredModel(SceneModel):
    """The table of a law or of a part of a law; `declared` is the class that declares its parameters."""

    declared: ClassVar[Declared]

    @model_validator(mode="before")
    @classmethod
    def _can_fail(cls, value: Any) -> Any:
        if isinstance(value, dict) and value.get("failure") is not None and "failure" not in cls.model_fields:
            expected = "no such key: failure is of plastic flow, in the kind 'elastic-plastic'"
            reject((("failure",), expected, value["failure"]))
        return value

    @model_validator(mode="after")
    def _consistent(self) -> "DeclaredModel":
        declared = type(self).declared
        reject(*getattr(declared, "faults", lambda stated: ())(self))
        if hasattr(declared, "source") and registry.can_be_tried(declared):
            law = self.build("space") if hasattr(self, "build") else self.part_of(density=1.0)
            wrong = registry.try_out(declared.role, law)
            if wrong is not None:
                reject((("law",), f"a file that can be run ({wrong})", self.law))  # type: ignore[attr-defined]
        return self

    def part_of(self, **of_material: Any) -> Any:
        """The NamedTuple in SI units; of_material: values that a part takes from its material."""
        return built(type(self).declared, self, **of_material)

    def __reduce__(self) -> tuple[Any, ...]:
        # a class made at run time cannot be pickled by name: it is made again from its declaration
        kind, state = type(self).declared, self.__getstate__()
        if hasattr(kind, "source"):
            return _restored, (registry.from_text, kind.source, state)
        if hasattr(kind, "role"):
            return _restored, (registry.declared, (kind.role, kind.kind), state)
        # an entry of a list has no role; its class is pickled by name
        return _restored, (None, (kind,), state)


def _restored(find: Callable[..., Declared] | None, arguments: tuple[Any, ...], state: dict[Any, Any]) -> DeclaredModel:
    """A table validated by another rank; find: finds or makes the class that declares the law, from `arguments`."""
    model = model_of(arguments[0] if find is None else find(*arguments))
    result = model.__new__(model)
    result.__setstate__(state)
    return result


# role -> base class of the tables of its laws
_BASES: dict[str, type[DeclaredModel]] = {}


def table_of(role: str) -> Callable[[type[DeclaredModel]], type[DeclaredModel]]:
    """Decorator of the base class of the tables of a role."""

    def enter(base: type[DeclaredModel]) -> type[DeclaredModel]:
        _BASES[role] = base
        return base

    return enter


@cache
def model_of(declared: Declared) -> type[DeclaredModel]:
    """The model of the table of a declared law, or of an entry of a list in it."""
    role = getattr(declared, "role", None)
    fields: dict[str, Any] = {}
    if hasattr(declared, "source"):
        fields["law"] = (str, Field(description="a file and the class in it, 'my_law.py:MyLaw'"))
        # defines the base classes of all roles
        import_module("parsolid.scene.materials")
    elif role is not None:
        fields["kind"] = (Literal[declared.kind], Field())
    for name, (plain, note) in parameters_of(declared).items():
        if not isinstance(note, OfMaterial | StateVariable):
            fields[name] = _field(plain, note)
    base = _BASES.get(role or "", DeclaredModel)
    make: Any = create_model
    model = make(declared.__name__, __base__=base, __module__=__name__, __doc__=declared.__doc__, **fields)
    model.declared = declared
    if "law" in fields:
        model.kind = declared.kind
    # the table has the methods, properties and groups of keys of the declaration
    for owner in reversed(declared.__mro__):
        if not issubclass(owner, tuple) and owner is not object:
            for name, value in vars(owner).items():
                if isinstance(value, FunctionType | property) or name in ("exactly_one", "at_most_one"):
                    setattr(model, name, value)
    result: type[DeclaredModel] = model
    return result


def _field(plain: Any, parameter: Parameter | OfParticle) -> tuple[Any, Any]:
    """Type and field of a parameter, or of a member that differs between particles."""
    if isinstance(parameter, OfParticle):
        return field_of_particles(parameter)
    bounds: dict[str, Any] = {"gt": parameter.above, "ge": parameter.at_least, "lt": parameter.below}
    bounds |= {"le": parameter.at_most, "max_length": parameter.most}
    bounds = {word: bound for word, bound in bounds.items() if bound is not None}
    optional = type(None) in get_args(plain)
    kind = next(t for t in get_args(plain) if t is not type(None)) if optional else plain
    if hasattr(kind, "_fields"):
        kind = model_of(kind)
    if get_origin(kind) is list:
        kind = list[tuple(map(model_of, get_args(kind)))]  # type: ignore[misc]
    hint = Annotated[kind, Field(**bounds)] if bounds else kind
    default: dict[str, Any] = {} if parameter.default is NEEDED else {"default": parameter.default}
    return hint | None if optional else hint, Field(**default, description=parameter.text)


def law_files(scene: Any) -> list[str]:
    """Files of laws that the bodies of a scene and their parts name with `law`."""
    tables = [body.material for body in scene.bodies]
    tables += [part for table in tables for part in getattr(table, "parts", {}).values()]
    failures = [getattr(table, "failure", None) for table in tables]
    tables += [criterion for failure in failures if failure is not None for criterion in failure.criteria]
    return sorted({table.law.rpartition(":")[0] for table in tables if isinstance(getattr(table, "law", None), str)})


class Laws:
    """Annotation of a union of tables of laws of some roles that also accepts laws from files (key `law`) and installed
    packages.
    """

    def __init__(self, roles: tuple[str, ...]) -> None:
        self.roles = roles

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        # also serializes tables that are not in the union
        stated = core_schema.plain_serializer_function_ser_schema(_stated, info_arg=True)
        return core_schema.with_info_wrap_validator_function(self._validate, handler(source), serialization=stated)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        installed = [registry.declared(role, kind) for role in self.roles for kind in registry.installed_kinds(role)]
        others = [handler(model_of(law).__pydantic_core_schema__) for law in installed]
        # the keys of a law from a file are not known here
        own = {
            "type": "object",
            "required": ["law"],
            "properties": {"law": {"type": "string"}},
            "not": {"required": ["kind"]},
        }
        return {"anyOf": [handler(schema), *others, own]}

    def _validate(self, value: Any, handler: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, dict):
            return value if isinstance(value, DeclaredModel) else handler(value)
        if "law" in value:
            return _law_of_file(value, self.roles, info)
        for role in self.roles:
            if value.get("kind") in registry.installed_kinds(role):
                try:
                    law = registry.declared(role, value["kind"])
                except LawError as error:
                    reject((("kind",), str(error), value["kind"]))
                return model_of(law).model_validate(value, context=info.context)
        return handler(value)


def _stated(table: DeclaredModel, info: Any) -> dict[str, Any]:
    stated = table.model_dump(mode=info.mode, exclude_none=info.exclude_none)
    # an infinite default is left out, because scenes accept finite numbers only
    return {key: value for key, value in stated.items() if value != inf}


def _law_of_file(value: dict[str, Any], roles: tuple[str, ...], info: ValidationInfo) -> Any:
    """The table of a law from a file, which is executed if that is allowed."""
    stated, context = value["law"], info.context or {}
    if "kind" in value:
        reject((("kind",), "no such key with law", value["kind"]))
    file, colon, name = stated.rpartition(":") if isinstance(stated, str) else ("", "", "")
    if not colon or not file or not name.isidentifier():
        reject((("law",), "a file and the class in it, such as 'my_law.py:MyLaw'", stated))
    path = os.path.abspath(os.path.join(context.get("folder", ""), file))
    if not context.get("again") and not context.get("trust_code"):
        expected = "--trust-code, or trust_code=True from Python (the scene names code that would be run)"
        reject((("law",), expected, stated))
    try:
        # again: the law as it was when the scene was first read
        again = context.get("again")
        law = registry.loaded(path, name) if again else registry.from_text(path, name, registry.text_of(path))
    except LawError as error:
        reject((("law",), str(error), stated))
    if law.role not in roles:
        reject((("law",), f"a law with the role {' or '.join(map(repr, roles))}", law.role))
    return model_of(law).model_validate(value | {"law": f"{path}:{name}"}, context=context)


def laws(*roles: str) -> Any:
    """The type of a field that holds a law of one of the roles, see `Laws`."""
    models = [model_of(registry.declared(role, kind)) for role in roles for kind in registry.own_kinds(role)]
    discriminator = [Field(discriminator="kind")] if len(models) > 1 else []
    return Annotated[Union[tuple(models)], *discriminator, Laws(roles)]  # noqa: UP007


Entry = TypeVar("Entry")


@cache
def stated_sets(path: Path) -> dict[str, dict[str, Any]]:
    """Name -> values of each set of a library's TOML file, without its source."""
    with open(path, "rb") as file:
        tables = tomllib.load(file)
    return {name: {key: value for key, value in table.items() if key != "source"} for name, table in tables.items()}


def entry(name: object, known: Mapping[str, Entry]) -> Entry:
    """The entry of a name; raises ValidationError at the key `library` for an unknown name."""
    if not isinstance(name, str) or name not in known:
        expected = f"one of {', '.join(map(repr, known)) or 'none'}{suggestion(name, known)}"
        reject((("library",), expected, name))
    return known[str(name)]


class LibraryTable(DeclaredModel):
    """A table with the key `library`: keys that are not given are those of the named entry of the library."""

    @classmethod
    def entries(cls) -> Mapping[str, dict[str, Any]]:
        """The library: name -> values."""
        raise NotImplementedError

    @classmethod
    def taken(cls, known: dict[str, Any], stated: dict[str, Any]) -> dict[str, Any]:
        """The values of an entry that apply beside those that the scene states; here all of them."""
        return known

    @model_validator(mode="wrap")
    @classmethod
    def _with_library(cls, value: Any, handler: Any) -> Any:
        name = value.get("library") if isinstance(value, dict) else None
        if name is None:
            return handler(value)
        given = {key: stated for key, stated in value.items() if stated is not None}
        return handler(cls.taken(entry(name, cls.entries()), given) | given)
