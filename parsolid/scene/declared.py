"""Tables of laws, made from what the laws declare (`materials.declaration`): a law's file is all that it takes."""

import os
from functools import cache
from importlib import import_module
from types import FunctionType
from typing import Annotated, Any, ClassVar, Literal, get_args, get_origin

from pydantic import Field, ValidationInfo, model_validator

from parsolid.materials import registry
from parsolid.materials.declaration import NEEDED, Declared, OfMaterial, Parameter, built, parameters_of
from parsolid.materials.registry import LawError
from parsolid.scene.base_model import ByKind, SceneModel, method_of, reject
from parsolid.scene.validation_errors import NOTHING


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
        # classes made at run time have no place to be found at
        kind = type(self).declared
        source = getattr(kind, "source", None)
        if source is None:
            # an entry of a list has no role, but is found by its own name
            source = (kind.role, kind.kind) if hasattr(kind, "role") else (kind,)
        return _restored, (source, self.__getstate__())


def _restored(source: tuple[Any, ...], state: dict[Any, Any]) -> DeclaredModel:
    """A table that another rank has validated, with the text of the law's file as that rank has read it."""
    ways: dict[int, Any] = {1: lambda kind: kind, 2: registry.declared, 3: registry.from_text}
    find = ways[len(source)]
    model = model_of(find(*source))
    result = model.__new__(model)
    result.__setstate__(state)
    return result


# what the tables of a role have in common, and the fields that end them; filled by `scene.materials`
BASES: dict[str | None, tuple[type[DeclaredModel], dict[str, tuple[Any, Any]]]] = {}


@cache
def model_of(declared: Declared) -> type[DeclaredModel]:
    """The model of the table in which a scene states a declared law."""
    role = getattr(declared, "role", None)
    import_module("parsolid.scene.materials")
    base, more = BASES.get(role, (DeclaredModel, {}))
    fields: dict[str, tuple[Any, Any]] = {}
    namespace: dict[str, Any] = {"declared": declared, "__module__": __name__, "__doc__": declared.__doc__}
    if hasattr(declared, "source"):
        fields["law"] = (str, Field(description="a file and the class in it, 'my_law.py:MyLaw'"))
        namespace["kind"] = declared.kind
    elif role is not None:
        fields["kind"] = (Literal[declared.kind], Field())
    fields |= {n: _field(t, p) for n, (t, p) in parameters_of(declared).items() if not isinstance(p, OfMaterial)}
    fields |= more
    for owner in reversed(declared.__mro__):
        if issubclass(owner, tuple) or owner is object:
            continue
        namespace |= {n: v for n, v in vars(owner).items() if isinstance(v, FunctionType | property) or n in _GROUPS}
    namespace["__annotations__"] = {name: hint for name, (hint, _) in fields.items()}
    if "kind" in namespace:
        namespace["__annotations__"]["kind"] = ClassVar[str]
    made: Any = type(base)
    return made(declared.__name__, (base,), namespace | {name: value for name, (_, value) in fields.items()})


_GROUPS = ("exactly_one", "at_most_one")


def _field(plain: Any, parameter: Parameter) -> tuple[Any, Any]:
    """Type and field of a parameter."""
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
    return hint | None if optional else hint, Field(**default, description=parameter.told)


def law_files(scene: Any) -> list[str]:
    """Files of the laws of a scene's bodies, and of their parts."""
    tables = [body.material for body in scene.bodies]
    tables += [part for table in tables for part in getattr(table, "parts", {}).values()]
    failures = [getattr(table, "failure", None) for table in tables]
    tables += [criterion for failure in failures if failure is not None for criterion in failure.criteria]
    return sorted({table.law.rpartition(":")[0] for table in tables if isinstance(getattr(table, "law", None), str)})


class ByLaw(ByKind):
    """Annotation of a field whose table names a law: by its `kind`, or by `law`, a file and a class in it.

    roles: those of the laws; known: the attribute of a method's settings that lists the roles which the method takes,
    "" where all will do.
    """

    def __init__(self, roles: tuple[str, ...], known: str = ""):
        self.roles, self.known = roles, known
        self.files: dict[str, type[DeclaredModel]] = {}

    @property
    def instances(self) -> tuple[type, ...]:
        """What needs no validation any more."""
        return (DeclaredModel,)

    def tables(self) -> dict[str, type[SceneModel]]:
        """Every kind and its model; laws of files have none before a scene names them."""
        return {kind: model_of(registry.declared(role, kind)) for role in self.roles for kind in registry.kinds(role)}

    def allowed(self, info: ValidationInfo | None, table: object = None) -> list[str]:
        """Kinds that the scene's method takes."""
        every = {kind: role for role in self.roles for kind in registry.kinds(role)}
        return [kind for kind, role in every.items() if self._takes(role, info)]

    def _takes(self, role: str, info: ValidationInfo | None) -> bool:
        method = method_of(info) if info is not None and self.known else None
        return method is None or role in getattr(method, self.known)

    def choose(self, table: object) -> type[SceneModel] | None:
        """The model for a table's kind or file; None when there is no such law, or its file has not been loaded."""
        if not isinstance(table, dict):
            return None
        kind = table.get("kind")
        if not isinstance(kind, str):
            return self.files.get(table["law"]) if isinstance(table.get("law"), str) else None
        for role in self.roles:
            if kind in registry.kinds(role):
                return model_of(registry.declared(role, kind))
        return None

    def chosen(self, value: dict[str, Any], info: ValidationInfo) -> type[SceneModel]:
        """The model for a raw table; raises ValidationError where it names none."""
        try:
            return self._of_file(value, info) if "law" in value else super().chosen(value, info)
        except LawError as error:
            key = "law" if "law" in value else "kind"
            reject(((key,), str(error), value[key]))
            raise

    def _of_file(self, value: dict[str, Any], info: ValidationInfo) -> type[SceneModel]:
        stated, context = value["law"], info.context or {}
        if "kind" in value:
            reject((("kind",), "no such key with law", value["kind"]))
        file, colon, name = stated.rpartition(":") if isinstance(stated, str) else ("", "", "")
        if not colon or not file or not name.isidentifier():
            reject((("law",), "a file and the class in it, such as 'my_law.py:MyLaw'", stated))
        path = os.path.abspath(os.path.join(context.get("folder", ""), file))
        declared: Declared
        if context.get("again"):
            # as it was when the scene was read first, whatever this rank's disk holds now
            declared = registry.loaded(path, name)
        elif context.get("trust_code"):
            declared = registry.from_text(path, name, registry.text_of(path))
        else:
            # what is run is said by who runs it, not by the scene
            expected = "--trust-code, or trust_code=True from Python (the scene names code that would be run)"
            reject((("law",), expected, stated))
        if declared.role not in self.roles or not self._takes(declared.role, info):
            known = [role for role in self.roles if self._takes(role, info)]
            reject((("law",), f"a law with the role {' or '.join(map(repr, known)) or NOTHING}", declared.role))
        value["law"] = f"{path}:{name}"
        self.files[value["law"]] = model_of(declared)
        return self.files[value["law"]]


def by_law(*roles: str, known: str = "") -> Any:
    """The type of a field that holds a law of one of the roles, see `ByLaw`."""
    return Annotated[Any, ByLaw(roles, known)]
