"""parsolid: solids simulated with particles on many processors."""

import os
from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# a rank is single-threaded: threads of a BLAS, once woken by one long product, spin on the cores of other ranks
for _library in ("OPENBLAS", "MKL", "BLIS", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# loaded when they are first asked for: `import parsolid` itself costs nothing
__all__ = [
    "Cadence",
    "Output",
    "OutputError",
    "Results",
    "RunFailed",
    "Scene",
    "SceneError",
    "Simulation",
    "SolverError",
    "load",
    "load_scene",
    "material",
    "run",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module("parsolid.api"), name)
    raise AttributeError(f"module 'parsolid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
