"""Boundary conditions of a scene: one file a kind; a file in this folder is all that a new kind needs to be found.

What a kind does to particles is in the package `boundary`; which kinds a method takes stands in its settings.
"""

from importlib import import_module
from pkgutil import iter_modules

from parsolid.scene.boundaries.condition import Boundary, Condition, boundary_kind


def find_kinds() -> None:
    """Import every file of this folder, which enters its kinds."""
    for module in iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")


find_kinds()

__all__ = ["Boundary", "Condition", "boundary_kind", "find_kinds"]
