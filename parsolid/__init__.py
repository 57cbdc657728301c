"""parsolid: solids simulated with particles on many processors."""

import os
from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# a rank is single-threaded: threads of a BLAS, once woken by one long product, spin on the cores of other ranks
for _library in ("OPENBLAS", "MKL", "BLIS", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# what is loaded when it is first asked for: `import parsolid` itself costs nothing
_OFFERED = ("load", "run", "set_up", "material", "OutputError", "RunFailed", "SceneError", "SolverError")


def __getattr__(name: str) -> Any:
    if name in _OFFERED:
        return getattr(import_module("parsolid.api"), name)
    raise AttributeError(f"module 'parsolid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_OFFERED])
