"""Boundary conditions of a scene: one file a kind; a file in this folder is all that a new kind needs to be found.

What a kind does to particles is in the package `boundary`; which kinds a method takes stands in its settings.
"""

from importlib import import_module
from pkgutil import iter_modules
from typing import Annotated, Any, Union

from pydantic import Field, WrapValidator

from parsolid.scene.boundaries.condition import BOUNDARY_KINDS, Condition, boundary_kind, of_method


def union_of_kinds() -> Any:
    """The type of a boundary's table: every file of this folder enters its kinds."""
    for module in iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")
    kinds: Any = Union[tuple(dict.fromkeys(BOUNDARY_KINDS.values()))]  # noqa: UP007
    return Annotated[kinds, Field(discriminator="kind"), WrapValidator(of_method)]


Boundary: Any = union_of_kinds()

__all__ = ["Boundary", "Condition", "boundary_kind"]
