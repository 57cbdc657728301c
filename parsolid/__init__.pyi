"""What `import parsolid` offers, for editors and type checkers."""

from parsolid.api.materials import material as material
from parsolid.api.modes import modes as modes
from parsolid.api.report import Report as Report
from parsolid.api.report import check as check
from parsolid.api.running import run as run
from parsolid.api.scenes import Scene as Scene
from parsolid.api.simulation import Simulation as Simulation
from parsolid.collective import SolverError as SolverError
from parsolid.output.errors import OutputError as OutputError
from parsolid.output.results import Results as Results
from parsolid.output.results import load as load
from parsolid.scene import SceneError as SceneError
from parsolid.scene import load_scene as load_scene
from parsolid.simulation.loop import RunFailed as RunFailed
from parsolid.simulation.outputs import Cadence as Cadence
from parsolid.simulation.outputs import Output as Output

__version__: str
