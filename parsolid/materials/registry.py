"""Laws found by role and kind: those of this package, those of installed packages, and those of a file that a scene
names.

Nothing is imported before a scene asks for it: laws of this package are found by the line of their decorator
`@law("role", "kind")`, those of other packages by entry points of the group "parsolid.laws" named "role.kind".
"""

import hashlib
import re
import sys
import traceback
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, get_type_hints

from parsolid.materials import user
from parsolid.materials.declaration import Declared, OfParticle, StateVariable, parameters_of
from parsolid.materials.failure.failure import Loading
from parsolid.materials.installed import entry_points

_LINE = re.compile(r'^@law\("([a-z-]+)", "([a-z0-9-]+)"\)', re.MULTILINE)
_PLASTIC, _FAILURE = "parsolid.materials.plastic.functions", "parsolid.materials.failure.functions"
# a copy of that of `parsolid.tensors`, a module that imports numba
_IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
_LOADING = Loading((0.0,) * 6, 0.0, 0.1, 0.01, 1.0, 300.0, 1e4)
# role -> module of the functions that its laws need, and arguments for each function near the state at rest
_FUNCTIONS: dict[str, tuple[str, dict[str, tuple[Any, ...]]]] = {
    "hyperelastic": (
        "parsolid.materials.hyperelastic.functions",
        dict.fromkeys(("energy", "stress", "pressure_waves"), (_IDENTITY, _IDENTITY, 1.0)) | {"elastic_moduli": ()},
    ),
    "flow-stress": (_PLASTIC, {"flow_stress": (0.1, 1.0, 300.0, 1e10, 1e4)}),
    "kinematic-hardening": (_PLASTIC, {"back_stress_step": (0.1,), "back_stress_energy": (1e10,)}),
    "shear-modulus": (_PLASTIC, {"shear_modulus": (1.0, 0.0, 300.0, 1e4)}),
    "melting": (_PLASTIC, {"melting_temperature": (1.0,)}),
    "failure": (_FAILURE, {"damage_after": (0.0, 1.0, _LOADING)}),
    "equation-of-state": (
        _PLASTIC,
        {
            "cold_pressure": (1.0,),
            "grueneisen_coefficient": (),
            "isentropic_bulk_modulus": (1.0, 0.0),
            "room_to_compress": (1.0,),
        },
    ),
}


class LawError(Exception):
    """A law cannot be loaded; the message says what was expected."""


@cache
def _own_modules() -> dict[tuple[str, str], str]:
    """(role, kind) -> module, of the laws of this package."""
    root, result = Path(__file__).parent, {}
    for source in sorted(root.glob("*/*.py")):
        for role, kind in _LINE.findall(source.read_text(encoding="utf-8")):
            result[role, kind] = f"parsolid.materials.{source.parent.name}.{source.stem}"
    return result


@cache
def _installed() -> dict[tuple[str, str], Any]:
    """(role, kind) -> entry point, of other packages."""
    result = {}
    for point in entry_points(group="parsolid.laws"):
        role, _, kind = point.name.partition(".")
        result[role, kind] = point
    return result


def own_kinds(role: str) -> list[str]:
    return [kind for r, kind in _own_modules() if r == role]


def installed_kinds(role: str) -> list[str]:
    """Further kinds of a role, of other packages."""
    return [kind for r, kind in _installed() if r == role and (r, kind) not in _own_modules()]


def kinds(role: str) -> tuple[str, ...]:
    """Kinds of a role, those of this package first."""
    return (*own_kinds(role), *installed_kinds(role))


def declared(role: str, kind: str) -> Declared:
    """The class declared under a name. Raises KeyError where there is none, LawError where it cannot be loaded."""
    if (role, kind) in _own_modules():
        own = vars(import_module(_own_modules()[role, kind])).values()
        return next(one for one in own if getattr(one, "role", None) == role and one.kind == kind)
    point = _installed()[role, kind]
    try:
        result = point.load()
    except Exception as error:
        raise LawError(f"an installed law that can be loaded ({error})") from error
    _complete(result)
    return result


_of_files: dict[tuple[str, str], Declared] = {}


def loaded(path: str, name: str) -> Declared:
    """A law of a file that this process has loaded already. Raises LawError."""
    if (path, name) not in _of_files:
        raise LawError("a law that has been loaded")
    return _of_files[path, name]


def loaded_texts() -> str:
    """The texts of all files of laws that this process has loaded."""
    return "".join(law.source[2] for _, law in sorted(_of_files.items(), key=lambda item: item[0]))


def text_of(path: str) -> str:
    """The text of a file of laws. Raises LawError."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise LawError(f"a file that can be read ({getattr(error, 'strerror', None) or error})") from error


def from_text(path: str, name: str, text: str) -> Declared:
    """The law `name` of a file whose text is given, which is run: the same on all ranks, whatever their disks hold.

    The module is named after the text, so that kernels compiled with another text are never taken for it. Raises
    LawError.
    """
    module = (
        f"parsolid_law_{re.sub(r'[^0-9a-zA-Z]', '_', Path(path).stem)}_{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    )
    if module not in sys.modules:
        new = ModuleType(module)
        new.__file__ = path
        sys.modules[module] = new
        try:
            exec(compile(text, path, "exec"), new.__dict__)
        except Exception as error:
            del sys.modules[module]
            raise LawError(f"a file that can be run ({type(error).__name__}: {error})") from error
        # numba tells NamedTuples apart by their names and the types in them alone: without a name of its own an edited
        # law would be computed by the kernels of the law before the edit
        digest = new.__name__.rpartition("_")[2]
        for kind in list(vars(new).values()):
            if isinstance(kind, type) and issubclass(kind, tuple) and kind.__module__ == new.__name__:
                # the annotations name things that only the module of the file knows
                kind.__annotations__ = get_type_hints(kind, include_extras=True)
                kind.__name__ = kind.__qualname__ = f"Law_{digest}_{kind.__qualname__}"
                kind.__module__ = user.__name__
                setattr(user, kind.__name__, kind)
    found = getattr(sys.modules[module], name, None)
    if not (isinstance(found, type) and hasattr(found, "role")):
        raise LawError(f'a class {name} with the decorator @law("role", "kind")')
    result: Declared = found
    _complete(result)
    _of_files[path, name] = result
    result.source = (path, name, text)
    return result


def _complete(declared: Declared) -> None:
    """Raise LawError where the law lacks a function that its role needs."""
    if not hasattr(declared, "_fields") or declared.role not in _FUNCTIONS:
        return
    module, functions = _FUNCTIONS[declared.role]
    lacking = [name for name in functions if not getattr(import_module(module), name).is_known_for(declared)]
    notes = [note for _, note in parameters_of(declared).values()]
    if declared.role == "hyperelastic" and any(isinstance(note, OfParticle) for note in notes):
        try:
            import_module("parsolid.materials.hyperelastic.at_particles").members_of_kind(declared)
        except TypeError as error:
            raise LawError(str(error)) from error
        states = any(isinstance(note, StateVariable) for note in notes)
        if states and not import_module(module).next_state.is_known_for(declared):
            lacking.append("next_state")
    if lacking:
        raise LawError(f"a law with {' and '.join(lacking)} (see docs/own-law.md)")


def can_be_tried(declared: Declared) -> bool:
    """Whether `try_out` has arguments for the functions of a law."""
    return declared.role in _FUNCTIONS


def try_out(role: str, law: Any) -> str | None:
    """Call the functions of a law in plain Python at a state like that at rest; what went wrong, with its place.

    In a kernel the fault would end in a message of the compiler.
    """
    try:
        module, functions = _FUNCTIONS[role]
        for name, arguments in functions.items():
            getattr(import_module(module), name)(law, *arguments)
        if role == "hyperelastic":
            import_module("parsolid.materials.hyperelastic.at_particles").after_step(law, _IDENTITY, _IDENTITY, 1.0)
    except Exception as error:
        places = traceback.extract_tb(error.__traceback__)
        return f"{type(error).__name__}: {error}, in {places[-1].name}, line {places[-1].lineno}"
    return None


def laws_of(scene: Any) -> list[Any]:
    """One law for each body, with the density of inertia, see `method_settings.MassScaling`."""
    state, factor = scene.method.state(scene.dimension), scene.method.inertia_factor
    laws = [law_of(body.material, state) for body in scene.bodies]
    return laws if factor == 1.0 else [_heavier(law, factor) for law in laws]


def _heavier(law: Any, factor: float) -> Any:
    """The law with its density times a factor and the same heat capacity by volume."""
    changed = {"density": factor * law.density}
    if hasattr(law, "specific_heat"):
        changed |= {name: getattr(law, name) / factor for name in ("specific_heat", "specific_heat_slope")}
        changed["heat_points"] = None if law.heat_points is None else law.heat_points.over(factor)
    return law._replace(**changed)


def law_at_origin(material: Any) -> Any:
    """The law of a material point, with directions and other fields of place taken at X = Y = Z = 0. Raises ValueError
    as `scene.materials.HyperelasticSolid.law_at`."""
    return material.law_at((0.0, 0.0, 0.0)) if hasattr(material, "law_at") else law_of(material)


def law_of(material: Any, state: str = "space") -> Any:
    """The parameters, a NamedTuple, of a material as a scene states it; state: see `MethodSettings.state`."""
    return material.build(state)
