"""What `import parsolid` offers, for editors and type checkers."""

from parsolid.api import (
    Cadence as Cadence,
)
from parsolid.api import (
    Output as Output,
)
from parsolid.api import (
    OutputError as OutputError,
)
from parsolid.api import (
    Results as Results,
)
from parsolid.api import (
    RunFailed as RunFailed,
)
from parsolid.api import (
    Scene as Scene,
)
from parsolid.api import (
    SceneError as SceneError,
)
from parsolid.api import (
    Simulation as Simulation,
)
from parsolid.api import (
    SolverError as SolverError,
)
from parsolid.api import (
    load as load,
)
from parsolid.api import (
    load_scene as load_scene,
)
from parsolid.api import (
    material as material,
)
from parsolid.api import (
    run as run,
)

__version__: str
