"""parsolid: solids simulated with particles on many processors."""

import os
from importlib import import_module
from typing import Any

__version__ = "0.2.0"

# a rank is single-threaded: threads of a BLAS, once woken by one long product, spin on the cores of other ranks
for _library in ("OPENBLAS", "MKL", "BLIS", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# module -> names, loaded when they are first asked for: `import parsolid` itself costs nothing
_HOMES = {
    "parsolid.api.materials": ("material",),
    "parsolid.api.modes": ("modes",),
    "parsolid.api.report": (
        "Report",
        "check",
    ),
    "parsolid.api.running": ("run",),
    "parsolid.api.scenes": ("Scene",),
    "parsolid.api.simulation": ("Simulation",),
    "parsolid.collective": ("SolverError",),
    "parsolid.output.errors": ("OutputError",),
    "parsolid.output.results": (
        "Results",
        "load",
    ),
    "parsolid.scene": (
        "SceneError",
        "load_scene",
    ),
    "parsolid.simulation.loop": ("RunFailed",),
    "parsolid.simulation.outputs": (
        "Cadence",
        "Output",
    ),
}


def __getattr__(name: str) -> Any:
    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module 'parsolid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *(name for names in _HOMES.values() for name in names)])
