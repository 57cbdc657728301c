"""What a notebook or a script of one's own uses: `parsolid.load`, `run`, `set_up`, `material`, and what they raise;
docs/python.md."""

from parsolid.api.materials import material
from parsolid.api.results import RunResults, load
from parsolid.api.running import run
from parsolid.api.stepping import SteppedSimulation, set_up
from parsolid.collective import SolverError
from parsolid.output.errors import OutputError
from parsolid.scene import SceneError
from parsolid.simulation.loop import RunFailed

__all__ = [
    "OutputError",
    "RunFailed",
    "RunResults",
    "SceneError",
    "SolverError",
    "SteppedSimulation",
    "load",
    "material",
    "run",
    "set_up",
]
