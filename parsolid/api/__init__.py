"""What a notebook or a script of one's own uses: `parsolid.load`, `run`, `set_up` and `material`; docs/python.md."""

from parsolid.api.materials import material
from parsolid.api.results import RunResults, load
from parsolid.api.running import run
from parsolid.api.stepping import SteppedSimulation, set_up

__all__ = ["RunResults", "SteppedSimulation", "load", "material", "run", "set_up"]
