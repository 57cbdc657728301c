"""Tables of laws, made from what the laws declare (`materials.declaration`): a law's file is all that it takes."""

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
from parsolid.scene.base_model import SceneModel, check_kind, method_of, reject
from parsolid.scene.formulas import InitialDirection, InitialScalar, formula_of_place
from parsolid.scene.validation_errors import NOTHING, suggestion


class OfCells(SceneModel):
    """Values that the elements of the body's mesh have in its file."""

    cell_data: Annotated[str, Field(min_length=1)] = Field(description="the name of the data in the mesh file")


class StatedDirection(SceneModel):
    """A direction at each particle; its length is of no matter."""

    exactly_one: ClassVar = (("angle", "vector", "cell_data"),)
    angle: InitialScalar | None = Field(None, description="angle [rad] from X to Y, a formula of the reference place")
    vector: InitialDirection | None = Field(None, description="components, formulas of the reference place")
    cell_data: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="the name of a vector that elements have in the mesh file of the body"
    )

    def evaluate(self, points: np.ndarray) -> np.ndarray:
        """Vectors (n, 3) at points (n, d) [m], of any length; not of cell data."""
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
    """Type and field of a table for a member that particles have values of, state variables apart."""
    told = f"{note.description} [{note.unit}]" if note.unit != "1" else note.description
    if isinstance(note, Direction):
        needed: dict[str, Any] = {} if note.needed else {"default": None}
        kind = StatedDirection if note.needed else StatedDirection | None
        return kind, Field(**needed, description=f"a table: angle, vector or cell_data; the direction {told}".strip())
    if isinstance(note, BandWidth):
        return StatedNumber | None, Field(None, description=f"the width of the band of {told}; of the spacing if none")
    return StatedNumber, Field(description=told or None)


class DeclaredModel(SceneModel):
    """The table of a law or of a part of one; `declared` is the class that states its parameters."""

    declared: ClassVar[Declared]

    @model_validator(mode="before")
    @classmethod
    def _can_fail(cls, value: Any) -> Any:
        if isinstance(value, dict) and value.get("failure") is not None and "failure" not in cls.model_fields:
            # not merely an unknown key: somebody has meant it
            expected = "no such key: failure is of plastic flow, in the kind 'elastic-plastic'"
            reject((("failure",), expected, value["failure"]))
        return value

    @model_validator(mode="after")
    def _sound(self) -> "DeclaredModel":
        declared = type(self).declared
        reject(*getattr(declared, "faults", lambda stated: ())(self))
        if hasattr(declared, "source") and registry.can_be_tried(declared):
            law = self.build("space") if hasattr(self, "build") else self.part_of(density=1.0)
            wrong = registry.try_out(declared.role, law)
            if wrong is not None:
                reject((("law",), f"a file that can be run ({wrong})", self.law))  # type: ignore[attr-defined]
        return self

    def part_of(self, **of_material: Any) -> Any:
        """The NamedTuple in SI units; of_material: what parts take from their material."""
        return built(type(self).declared, self, **of_material)

    def __reduce__(self) -> tuple[Any, ...]:
        # models made at run time cannot be found by their names: they are made again of what declares them
        kind, state = type(self).declared, self.__getstate__()
        if hasattr(kind, "source"):
            return _restored, (registry.from_text, kind.source, state)
        if hasattr(kind, "role"):
            return _restored, (registry.declared, (kind.role, kind.kind), state)
        # an entry of a list has no role, but is found by its own name
        return _restored, (None, (kind,), state)


def _restored(find: Callable[..., Declared] | None, arguments: tuple[Any, ...], state: dict[Any, Any]) -> DeclaredModel:
    """A table that another rank has validated, with the text of the law's file as that rank has read it."""
    model = model_of(arguments[0] if find is None else find(*arguments))
    result = model.__new__(model)
    result.__setstate__(state)
    return result


# what the tables of a role have in common besides what its laws declare
_BASES: dict[str, type[DeclaredModel]] = {}


def table_of(role: str) -> Callable[[type[DeclaredModel]], type[DeclaredModel]]:
    """Decorator: what tables of a role have in common."""

    def enter(base: type[DeclaredModel]) -> type[DeclaredModel]:
        _BASES[role] = base
        return base

    return enter


@cache
def model_of(declared: Declared) -> type[DeclaredModel]:
    """The model of the table in which a scene states a declared law, or an entry of a list that one has."""
    role = getattr(declared, "role", None)
    fields: dict[str, Any] = {}
    if hasattr(declared, "source"):
        fields["law"] = (str, Field(description="a file and the class in it, 'my_law.py:MyLaw'"))
        # a file may be of any role
        import_module("parsolid.scene.materials")
    elif role is not None:
        fields["kind"] = (Literal[declared.kind], Field())
    stated = {n: it for n, it in parameters_of(declared).items() if not isinstance(it[1], OfMaterial | StateVariable)}
    fields |= {name: _field(plain, note) for name, (plain, note) in stated.items()}
    base = _BASES.get(role or "", DeclaredModel)
    make: Any = create_model
    made = make(declared.__name__, __base__=base, __module__=__name__, __doc__=declared.__doc__, **fields)
    made.declared = declared
    if "law" in fields:
        made.kind = declared.kind
    for owner in reversed(declared.__mro__):
        if not issubclass(owner, tuple) and owner is not object:
            for name, value in vars(owner).items():
                if isinstance(value, FunctionType | property) or name in _GROUPS:
                    setattr(made, name, value)
    result: type[DeclaredModel] = made
    return result


_GROUPS = ("exactly_one", "at_most_one")


def _field(plain: Any, parameter: Parameter | OfParticle) -> tuple[Any, Any]:
    """Type and field of a parameter, or of what particles have values of."""
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
    """Files of the laws of a scene's bodies, and of their parts."""
    tables = [body.material for body in scene.bodies]
    tables += [part for table in tables for part in getattr(table, "parts", {}).values()]
    failures = [getattr(table, "failure", None) for table in tables]
    tables += [criterion for failure in failures if failure is not None for criterion in failure.criteria]
    return sorted({table.law.rpartition(":")[0] for table in tables if isinstance(getattr(table, "law", None), str)})


class Laws:
    """Annotation of a union of the tables of laws: a table may name another one, by its key `law`, a file and a class
    in it, or by the kind of an installed package; and the scene's method has to take its role.

    roles: those of the laws; of_method: whether the methods' settings list the roles that they take.
    """

    def __init__(self, roles: tuple[str, ...], of_method: bool) -> None:
        self.roles, self.of_method = roles, of_method

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        # a law that is none of the union states itself, too
        stated = core_schema.plain_serializer_function_ser_schema(_stated, info_arg=True)
        return core_schema.with_info_wrap_validator_function(self._validate, handler(source), serialization=stated)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        installed = [registry.declared(role, kind) for role in self.roles for kind in registry.installed_kinds(role)]
        others = [handler(model_of(law).__pydantic_core_schema__) for law in installed]
        # of a law of one's own only its file says what it takes
        own = {
            "type": "object",
            "required": ["law"],
            "properties": {"law": {"type": "string"}},
            "not": {"required": ["kind"]},
        }
        return {"anyOf": [handler(schema), *others, own]}

    def _taken(self, info: ValidationInfo) -> list[str]:
        method: Any = method_of(info) if self.of_method else None
        return [role for role in self.roles if method is None or role in method.materials]

    def _validate(self, value: Any, handler: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, dict):
            return value if isinstance(value, DeclaredModel) else handler(value)
        if "law" in value:
            return _law_of_file(value, self._taken(info), info)
        every, taken = (
            [kind for role in roles for kind in registry.kinds(role)] for roles in (self.roles, self._taken(info))
        )
        check_kind(value, info, every, taken)
        for role in self.roles:
            if value["kind"] in registry.installed_kinds(role):
                # the table of a law of an installed package
                try:
                    law = registry.declared(role, value["kind"])
                except LawError as error:
                    reject((("kind",), str(error), value["kind"]))
                return model_of(law).model_validate(value, context=info.context)
        return handler(value)


def _stated(table: DeclaredModel, info: Any) -> dict[str, Any]:
    stated = table.model_dump(mode=info.mode, exclude_none=info.exclude_none)
    # a bound that a law lacks by default; scenes take finite numbers alone
    return {key: value for key, value in stated.items() if value != inf}


def _law_of_file(value: dict[str, Any], taken: list[str], info: ValidationInfo) -> Any:
    """The table of a law of one's own, whose file is run if that is allowed."""
    stated, context = value["law"], info.context or {}
    if "kind" in value:
        reject((("kind",), "no such key with law", value["kind"]))
    file, colon, name = stated.rpartition(":") if isinstance(stated, str) else ("", "", "")
    if not colon or not file or not name.isidentifier():
        reject((("law",), "a file and the class in it, such as 'my_law.py:MyLaw'", stated))
    path = os.path.abspath(os.path.join(context.get("folder", ""), file))
    if not context.get("again") and not context.get("trust_code"):
        # what is run is said by who runs it, not by the scene
        expected = "--trust-code, or trust_code=True from Python (the scene names code that would be run)"
        reject((("law",), expected, stated))
    try:
        # again: as it was when the scene was read first, whatever this rank's disk holds now
        again = context.get("again")
        law = registry.loaded(path, name) if again else registry.from_text(path, name, registry.text_of(path))
    except LawError as error:
        reject((("law",), str(error), stated))
    if law.role not in taken:
        reject((("law",), f"a law with the role {' or '.join(map(repr, taken)) or NOTHING}", law.role))
    return model_of(law).model_validate(value | {"law": f"{path}:{name}"}, context=context)


def laws(*roles: str, of_method: bool = False) -> Any:
    """The type of a field that holds a law of one of the roles, see `Laws`."""
    models = [model_of(registry.declared(role, kind)) for role in roles for kind in registry.own_kinds(role)]
    told_apart = [Field(discriminator="kind")] if len(models) > 1 else []
    return Annotated[Union[tuple(models)], *told_apart, Laws(roles, of_method)]  # noqa: UP007


Entry = TypeVar("Entry")


@cache
def stated_sets(path: Path) -> dict[str, dict[str, Any]]:
    """Name -> what each set of a library's TOML file states, without where it was published."""
    with open(path, "rb") as file:
        tables = tomllib.load(file)
    return {name: {key: value for key, value in table.items() if key != "source"} for name, table in tables.items()}


def entry(name: object, known: Mapping[str, Entry]) -> Entry:
    """The entry of a name; raises ValidationError at the key `library` for what is no name of one."""
    if not isinstance(name, str) or name not in known:
        expected = f"one of {', '.join(map(repr, known)) or 'none'}{suggestion(name, known)}"
        reject((("library",), expected, name))
    return known[str(name)]


class LibraryTable(DeclaredModel):
    """What is not given is that of the library, if one is named."""

    @classmethod
    def entries(cls) -> Mapping[str, dict[str, Any]]:
        """The library."""
        raise NotImplementedError

    @classmethod
    def taken(cls, known: dict[str, Any], stated: dict[str, Any]) -> dict[str, Any]:
        """What is taken of an entry beside what the scene states: all of it."""
        return known

    @model_validator(mode="wrap")
    @classmethod
    def _with_library(cls, value: Any, handler: Any) -> Any:
        name = value.get("library") if isinstance(value, dict) else None
        if name is None:
            return handler(value)
        given = {key: stated for key, stated in value.items() if stated is not None}
        return handler(cls.taken(entry(name, cls.entries()), given) | given)
