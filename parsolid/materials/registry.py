"""Laws found by role and kind: those of this package, those of installed packages, and those of a file that a scene
names.

Nothing is imported before a scene asks for it: laws of this package are found by the line of their decorator
`@law("role", "kind")`, those of other packages by entry points of the group "parsolid.laws" named "role.kind".
"""

import builtins
import dis
import hashlib
import re
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, get_type_hints

from parsolid.materials import user
from parsolid.materials.declaration import Declared, declared_as
from parsolid.materials.installed import entry_points

_LINE = re.compile(r'^@law\("([a-z-]+)", "([a-z0-9-]+)"\)', re.MULTILINE)
# where the functions are that kernels ask of the laws of a role; one of each group is enough
_PLASTIC = "parsolid.materials.plastic.plasticity"
_FUNCTIONS: dict[str, tuple[str, tuple[tuple[str, ...], ...]]] = {
    "hyperelastic": (
        "parsolid.materials.hyperelastic.law",
        (
            ("equilibrium_energy",),
            ("elastic_moduli",),
            ("first_piola_kirchhoff_stress", "equilibrium_stress"),
            ("pressure_wave_tensor", "equilibrium_wave_tensor"),
        ),
    ),
    "flow-stress": (_PLASTIC, (("flow_stress",),)),
    "shear-modulus": (_PLASTIC, (("shear_modulus",),)),
    "melting": (_PLASTIC, (("melting_temperature",),)),
    "failure": ("parsolid.materials.failure.failure", (("damage_after",),)),
    "equation-of-state": (
        _PLASTIC,
        (("cold_pressure",), ("grueneisen_coefficient",), ("isentropic_bulk_modulus",), ("room_to_compress",)),
    ),
}


class LawError(Exception):
    """A law cannot be had; the message says what was expected."""


@cache
def _found() -> dict[tuple[str, str], str]:
    """(role, kind) -> module, of this package."""
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


def kinds(role: str) -> tuple[str, ...]:
    """Kinds of a role, those of this package first."""
    return tuple(dict.fromkeys(kind for known in (_found(), _installed()) for r, kind in known if r == role))


def declared(role: str, kind: str) -> Declared:
    """The class declared under a name. Raises KeyError where there is none, LawError where it cannot be loaded."""
    if (role, kind) in _found():
        import_module(_found()[role, kind])
        return declared_as(role, kind)
    try:
        result = _installed()[role, kind].load()
    except KeyError:
        raise
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
            code = compile(text, path, "exec")
            exec(code, new.__dict__)
            _check_names(code, {*vars(new), *vars(builtins), *_set_by_functions(code)})
        except Exception as error:
            del sys.modules[module]
            raise LawError(f"a file that can be run ({type(error).__name__}: {error})") from error
        _name_apart(new)
    found = getattr(sys.modules[module], name, None)
    if not (isinstance(found, type) and hasattr(found, "role")):
        raise LawError(f'a class {name} with the decorator @law("role", "kind")')
    result: Declared = found
    _complete(result)
    _of_files[path, name] = result
    result.source = (path, name, text)
    return result


def _set_by_functions(code: CodeType) -> set[str]:
    """Names that functions of a file declare `global` and set when they are called."""
    own = {str(step.argval) for step in dis.get_instructions(code) if step.opname == "STORE_GLOBAL"}
    return own.union(*(_set_by_functions(one) for one in code.co_consts if isinstance(one, CodeType)))


def _check_names(code: CodeType, known: set[str]) -> None:
    """Raise NameError where a function of a file uses a name that is not known there.

    Compiled in a kernel it would be told in a compiler's words.
    """
    for inner in (one for one in code.co_consts if isinstance(one, CodeType)):
        line = inner.co_firstlineno
        for step in dis.get_instructions(inner):
            line = getattr(getattr(step, "positions", None), "lineno", None) or step.starts_line or line
            name = step.argval
            if step.opname == "LOAD_GLOBAL" and name not in known:
                raise NameError(f"{name!r} is not known, in {inner.co_name}, line {line}")
        _check_names(inner, known)


def _name_apart(module: ModuleType) -> None:
    """Give the NamedTuples of a file names that no other text has, by which numba's cache finds them.

    When Python calls a kernel, numba tells classes apart by their names and the types in them alone: an edited law
    would be computed by the one that this process has called before.
    """
    digest = module.__name__.rpartition("_")[2]
    for kind in list(vars(module).values()):
        if isinstance(kind, type) and issubclass(kind, tuple) and kind.__module__ == module.__name__:
            # what the annotations name is known in the module of the file alone
            kind.__annotations__ = get_type_hints(kind, include_extras=True)
            kind.__name__ = kind.__qualname__ = f"Law_{digest}_{kind.__qualname__}"
            kind.__module__ = user.__name__
            setattr(user, kind.__name__, kind)


def _complete(declared: Declared) -> None:
    """Raise LawError where the law lacks a function that kernels ask for, one of the names of each group."""
    if not hasattr(declared, "_fields") or declared.role not in _FUNCTIONS:
        return
    module, groups = _FUNCTIONS[declared.role]
    room = import_module(module)
    lacking = [names[-1] for names in groups if not any(getattr(room, name).table.has(declared) for name in names)]
    if lacking:
        raise LawError(f"a law with {' and '.join(lacking)} (see docs/laws.md)")


def laws_of(scene: Any) -> list[Any]:
    """One law for each body."""
    state = scene.method.state(scene.dimension)
    return [law_of(body.material, state) for body in scene.bodies]


def law_of(material: Any, state: str = "space") -> Any:
    """The parameters, a NamedTuple, of a material as a scene states it; state: see `MethodSettings.state`."""
    return material.build(state)
