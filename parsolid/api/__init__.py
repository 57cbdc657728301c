"""The Python interface, which the command line calls, too; docs/python.md."""

from parsolid.api.materials import material
from parsolid.api.running import run
from parsolid.api.scenes import Scene
from parsolid.api.simulation import Simulation
from parsolid.collective import SolverError
from parsolid.output.errors import OutputError
from parsolid.output.results import Results, load
from parsolid.scene import SceneError, load_scene
from parsolid.simulation.loop import RunFailed
from parsolid.simulation.outputs import Cadence, Output

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
