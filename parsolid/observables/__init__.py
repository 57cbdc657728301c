"""What can be watched of a run: fields of particles and quantities that `scene.observed` names, computed here.

A new one is a line there and a function or a class in a file of this folder.
"""

from importlib import import_module
from pkgutil import iter_modules


def load() -> None:
    """Import every file of this folder, so that what it declares is known."""
    for module in iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")


load()
