"""The pictures that a run draws at its end."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

from mpi4py import MPI

from parsolid.output.log import print_line
from parsolid.simulation.warmup import wait_quietly

# packages that draw
_NEEDED = ("matplotlib", "pyvista")
# a run that has taken no longer [s] draws only where its scene says so: packages that draw take seconds to load
LEAST_SECONDS = 20.0
# nothing is waited for longer [s]
MOST_SECONDS = 120.0


def missing() -> list[str]:
    """Packages that pictures need and that are not installed."""
    return [name for name in _NEEDED if importlib.util.find_spec(name) is None]


def draw_at_end(comm: MPI.Intracomm, folder: Path, stated: bool | None, seconds: float, quiet: bool = False) -> None:
    """Draw the standard set of pictures of a run into its folder, where it has taken long enough, or say how to.

    stated: what the scene says of pictures; seconds: what the run has taken; quiet: nothing is said. Collective: other
    ranks sleep meanwhile.
    """
    if stated is False:
        return
    if comm.rank == 0 and not missing():
        if stated or seconds > LEAST_SECONDS:
            draw(folder)
        elif not quiet:
            print_line(f"pictures: parsolid plot {folder}")
    wait_quietly(comm)


def draw(folder: Path) -> None:
    """Draw the standard set in a process of its own, which a fault of a graphics driver may end; for one rank alone.

    What went wrong is told in one line on the error stream.
    """
    # the child is no rank: it must not ask the launcher to be one
    environment = os.environ | {"MPI4PY_RC_INITIALIZE": "false"}
    command = [sys.executable, "-m", "parsolid.commands.plot", str(folder.resolve())]
    try:
        ended = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=MOST_SECONDS, check=False
        )
        fault = ended.stderr.strip().splitlines()[-1:] or [f"exit status {ended.returncode}"]
        fault = fault if ended.returncode else []
    except subprocess.TimeoutExpired:
        fault = [f"not done after {MOST_SECONDS:g} s"]
    except OSError as error:
        fault = [str(error)]
    for text in fault:
        print(f"no pictures: {text}", file=sys.stderr, flush=True)
