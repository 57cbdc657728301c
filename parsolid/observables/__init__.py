"""What can be watched of a run: fields of particles and quantities, each declared once, in the file that computes it.

The reader of scenes takes their names from here, and so do probes, field output and exact solutions. A new one is a new
file.
"""

from importlib import import_module
from pkgutil import iter_modules


def load() -> None:
    """Import every file of this folder, so that what it declares is known."""
    for module in iter_modules(__path__):
        import_module(f"{__name__}.{module.name}")


load()
