"""Digests of the texts that a kernel is compiled from: its module's, those of its argument types, and all that they
import of the same project.
"""

import functools
import hashlib
import os
import re
import sys
from pathlib import Path
from typing import Any

_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]*(\((?:[^)#]|#[^\n]*)*\)|[^\n]*)|import[ \t]+([\w., \t]+))",
    re.MULTILINE,
)
# module, name and fields of a class
ClassName = tuple[str, str, tuple[str, ...]]
_OURS = ("parsolid", "decomposition")
_LIBRARY = Path(os.__file__).parent
# how kernels are kept says nothing of what they do
KEEPERS = ("decomposition.compiled", "decomposition.deferred", "decomposition.kernel_sources")
# modules of a function, of the type that it is implemented for (with its name; None for all other arguments), and of
# the implementation
_IMPLEMENTED: set[tuple[str, tuple[str, str] | None, str]] = set()
# names of the classes that a class of named tuples is made of, itself the first
_BASES: dict[tuple[str, str], tuple[tuple[str, str], ...]] = {}


@functools.cache
def _text(module: str) -> tuple[bytes, tuple[str, ...]]:
    """A module's source and the modules of its project that it imports; nothing of other projects."""
    path = _source(module)
    if path is None:
        return b"", ()
    text = path.read_bytes()
    return text, tuple(sorted(_imported(module, text.decode())))


@functools.cache
def _source(module: str) -> Path | None:
    loaded = sys.modules.get(module)
    if loaded is not None and getattr(loaded, "__file__", None):
        path = Path(str(loaded.__file__))
        return path if path.suffix == ".py" and path.exists() else None
    # not loaded: beside the modules of the same package
    top, *rest = module.split(".")
    package = sys.modules.get(top)
    for root in getattr(package, "__path__", ()):
        place = os.path.join(root, *rest)
        for candidate in (f"{place}.py", os.path.join(place, "__init__.py")):
            if rest and os.path.isfile(candidate):
                return Path(candidate)
    return None


def _imported(module: str, text: str) -> set[str]:
    """Names of modules that a text imports, of this project or beside the module itself."""
    found: set[str] = set()
    for start, names, plain in _IMPORT.findall(text):
        if start:
            start = _absolute(start, module)
            parts = [name.split()[0] for name in re.sub(r"#[^\n]*|[()\\]", " ", names).split(",") if name.strip()]
            modules = {f"{start}.{name}" for name in parts if _is_ours(f"{start}.{name}", module)}
            found |= modules if len(modules) == len(parts) else modules | {start}
        else:
            found |= {name.split()[0] for name in plain.split(",") if name.strip()}
    return {name for name in found if name != module and _is_ours(name, module)}


def _absolute(start: str, module: str) -> str:
    """What a module means by a name that begins with points."""
    name = start.lstrip(".")
    up, source = len(start) - len(name), _source(module)
    if not up or source is None:
        return start
    parts = module.split(".")[: None if source.name == "__init__.py" else -1]
    return ".".join([*parts[: len(parts) + 1 - up], *([name] if name else [])])


def _is_ours(name: str, importer: str) -> bool:
    if importer.partition(".")[0] in _OURS:
        return name.partition(".")[0] in _OURS and _source(name) is not None
    source, here = _source(name), _source(importer)
    return source is not None and (
        name.partition(".")[0] in _OURS or (here is not None and source.parent == here.parent)
    )


@functools.cache
def reached(module: str) -> frozenset[str]:
    """A module and all that it imports of its project, directly or not."""
    found, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        if name not in found and name not in KEEPERS:
            found.add(name)
            waiting += _text(name)[1]
    return frozenset(found)


def is_followed(module: str) -> bool:
    """Whether the text of a module may change: of this project, or of none that is installed."""
    path = _source(module)
    inside = path is not None and not path.is_relative_to(_LIBRARY) and "site-packages" not in path.parts
    return path is not None and (inside or module.partition(".")[0] in _OURS)


def implemented(generic: str, kind: Any, module: str) -> None:
    """Say that a module implements a function of the module `generic` for a class, or for all else: what calls the
    function follows from that module though nothing that it imports does.
    """
    named_kind = _name(kind) if hasattr(kind, "_fields") else None
    if module != generic and (named_kind is None or module != named_kind[0]):
        _IMPLEMENTED.add((generic, named_kind, module))
        covered.cache_clear()
        digest_of.cache_clear()


@functools.cache
def covered(modules: frozenset[str], classes: frozenset[ClassName]) -> frozenset[str]:
    """Modules that a kernel of some modules and of classes in its arguments follows from: what they reach, and what
    implements a function found there.
    """
    kinds = {None, *(base for it in classes for base in _BASES.get(it[:2], (it[:2],)))}
    found, waiting = set[str](), {*modules, *(it[0] for it in classes)}
    while waiting:
        found.update(*map(reached, waiting))
        waiting = {it for generic, kind, it in _IMPLEMENTED if it not in found and generic in found and kind in kinds}
    return frozenset(found)


@functools.cache
def digest_of(modules: frozenset[str], classes: frozenset[ClassName]) -> bytes:
    """A digest of the text of all that a kernel follows from, see `covered`."""
    digest = hashlib.sha256()
    for name in sorted(covered(modules, classes)):
        digest.update(name.encode() + b"\0" + _digest_of_text(name))
    return digest.digest()


@functools.cache
def _digest_of_text(module: str) -> bytes:
    return hashlib.sha256(_text(module)[0]).digest()


def named(cls: Any) -> ClassName:
    """The module, the name and the fields of a class of named tuples: numba names types by the class's name alone, and
    one machine code takes the fields of one class in their order.
    """
    _BASES[_name(cls)] = tuple(map(_name, cls.__mro__))
    return *_name(cls), cls._fields


def _name(cls: Any) -> tuple[str, str]:
    return cls.__module__, cls.__qualname__


def classes_of(kind: Any) -> tuple[ClassName, ...]:
    """The classes in an argument type of numba's, in order; a kernel may have functions of theirs compiled in."""
    from numba.core.types import BaseNamedTuple, BaseTuple, Optional  # type: ignore[attr-defined]

    if isinstance(kind, BaseNamedTuple):
        return named(kind.instance_class), *_in_all(kind.types)
    if isinstance(kind, BaseTuple):
        return _in_all(kind)
    if isinstance(kind, Optional):
        return classes_of(kind.type)
    return ()


def _in_all(kinds: Any) -> tuple[ClassName, ...]:
    return tuple(it for kind in kinds for it in classes_of(kind))
