"""Fields of particles and quantities that a run can write, by the names of `scene.observed`.

A new one needs a line there and a function or a class in a file of this folder.
"""

from importlib import import_module
from pkgutil import iter_modules


def load() -> None:
    """Import every file of this folder, whose decorators declare fields and quantities."""
    for module in iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")


load()
