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
# runs below this time [s] draw only if the scene requests it, because loading the packages takes seconds
LEAST_SECONDS = 20.0
# time limit of drawing [s]
MOST_SECONDS = 120.0


def missing() -> list[str]:
    """Names of the packages for pictures that are not installed."""
    return [name for name in _NEEDED if importlib.util.find_spec(name) is None]


def draw_at_end(comm: MPI.Intracomm, folder: Path, stated: bool | None, seconds: float, quiet: bool = False) -> None:
    """Draw the standard pictures of a long run into its folder, or print the command for them. Collective.

    stated: the key `pictures` of the scene; seconds: time of the run [s]; quiet: print nothing. Other ranks sleep.
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
    """Draw the standard pictures in a subprocess, because a graphics driver may crash; for one rank.

    A failure gives one line on stderr.
    """
    # the subprocess must not initialise MPI as a rank of this job
    environment = os.environ | {"MPI4PY_RC_INITIALIZE": "false"}
    command = [sys.executable, "-m", "parsolid.commands.plot", str(folder.resolve())]
    fault = None
    try:
        ended = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=MOST_SECONDS, check=False
        )
        if ended.returncode:
            fault = (ended.stderr.strip().splitlines() or [f"exit status {ended.returncode}"])[-1]
    except subprocess.TimeoutExpired:
        fault = f"not done after {MOST_SECONDS:g} s"
    except OSError as error:
        fault = str(error)
    if fault is not None:
        print(f"no pictures: {fault}", file=sys.stderr, flush=True)
