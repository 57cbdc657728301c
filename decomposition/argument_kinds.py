"""Types of arguments as numba would name them, found without numba; by them the files of kernels are named.

`Kind.code` is what numba's dispatcher in C tells types by. Those codes lie far from numba's own, so that neither takes
the other's for one of its own when numba is imported later.
"""

from collections.abc import Iterable
from itertools import count
from typing import Any

import numpy as np

from decomposition.kernel_sources import ClassName, named

# numba counts from zero
_CODES = count(1 << 30)
_NUMBERS = tuple(f"{kind}{8 << k}" for kind in ("int", "uint") for k in range(4))
_NUMBERS += ("float32", "float64", "complex64", "complex128")
_SCALARS = frozenset((*_NUMBERS, "bool"))


class Kind:
    """A type: numba's name of it, None of what is numba's affair, and the classes in it, as `kernel_sources.named`."""

    __slots__ = ("_code", "classes", "name")

    def __init__(self, name: str | None, classes: tuple[ClassName, ...] = ()) -> None:
        self.name, self.classes, self._code = name, classes, next(_CODES)

    @property
    def code(self) -> int:
        """What tells it from others."""
        return self._code


_NAMED = {name: Kind(name) for name in (*_NUMBERS, "bool", "none")}
_OF_CLASS: dict[type, Kind] = {
    bool: _NAMED["bool"],
    float: _NAMED["float64"],
    type(None): _NAMED["none"],
    **{np.dtype(name).type: _NAMED[name] for name in _SCALARS},
}
_OF_ARRAYS: dict[Any, Kind] = {}
_OF_TUPLES: dict[Any, Kind] = {}


def number_codes() -> dict[str, int]:
    """Codes of the types of numbers, by name."""
    return {name: _NAMED[name].code for name in _NUMBERS}


def kind_of(value: Any) -> Kind:
    """The type of a value."""
    cls = type(value)
    if cls is np.ndarray:
        key = value.dtype, value.ndim, value.flags.num
        return _OF_ARRAYS.get(key) or _OF_ARRAYS.setdefault(key, _array(value))
    if cls is int:
        return _NAMED["int64"] if -(1 << 63) <= value < 1 << 63 else _unknown(cls)
    if isinstance(value, tuple):
        inner = tuple(map(kind_of, value))
        return _OF_TUPLES.get((cls, inner)) or _OF_TUPLES.setdefault((cls, inner), _tuple(cls, inner))
    return _OF_CLASS.get(cls) or _unknown(cls)


def _unknown(cls: type) -> Kind:
    key = cls, None
    return _OF_TUPLES.get(key) or _OF_TUPLES.setdefault(key, Kind(None))


def _array(value: np.ndarray) -> Kind:
    """As numba names it: by what the elements are, layout, and whether it may be written to."""
    flags, dtype = value.flags, value.dtype
    if dtype.name not in _SCALARS or not dtype.isnative or not flags.aligned:
        return Kind(None)
    layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
    name = f"{'' if flags.writeable else 'readonly '}array({dtype.name}, {value.ndim}d, {layout})"
    return _NAMED.get(name) or _NAMED.setdefault(name, Kind(name))


def _tuple(cls: type, inner: tuple[Kind, ...]) -> Kind:
    names = [kind.name for kind in inner]
    known = [name for name in names if name is not None]
    is_named = cls is not tuple and hasattr(cls, "_fields")
    if len(known) < len(names) or not (cls is tuple or is_named):
        return Kind(None)
    classes = classes_in(inner)
    alike = len(known) > 0 and len(set(known)) == 1
    content = f"{known[0]} x {len(known)}" if alike else ", ".join(known)
    if cls is tuple:
        return Kind(f"{'UniTuple' if alike else 'Tuple'}({content})", classes)
    return Kind(f"{cls.__name__}({content})", (named(cls), *classes))


def classes_in(kinds: Iterable[Kind]) -> tuple[ClassName, ...]:
    """The classes in types, in order."""
    return tuple(it for kind in kinds for it in kind.classes)
