"""Smoothing kernels, one file each, found by the files' names; a new one is a new file with a `KERNEL`.

W(q) = c sqrt(det M) f(q), q^2 = x . M x, with the metric M = h^{-2} along own axes. Each kernel is a type; only the
gradient is needed, grad W = c sqrt(det M) f'(q)/q M x.
"""

from importlib import import_module
from pkgutil import iter_modules
from typing import Any


def kernel_names() -> tuple[str, ...]:
    """Names of the kernels in a scene, found without loading their files."""
    return tuple(sorted(file.name.replace("_", "-") for file in iter_modules(__path__) if file.name != "gradient"))


def smoothing_kernel(name: str) -> Any:
    """The kernel of a name, a NamedTuple with `support` [h]."""
    return import_module(f"{__name__}.{name.replace('-', '_')}").KERNEL
