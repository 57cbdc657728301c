"""Whole runs from Python."""

import copy
import os
import subprocess
import tempfile
import time as clock
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from parsolid.api.results import RunResults, load
from parsolid.collective import SolverError
from parsolid.commands.cli import parse
from parsolid.commands.run import TO_BE_CONTINUED, bcast_scene, overrides_of, run_scene
from parsolid.launcher import start, stop
from parsolid.scene import Scene, SceneError, dump_scene, load_scene, parse_scene
from parsolid.scene.raw_tables import apply_override
from parsolid.simulation.loop import RunFailed


def run(
    scene: str | Path | dict[str, Any],
    output: str | Path | None = None,
    ranks: int | None = None,
    options: tuple[str, ...] = ("--quiet",),
    trust_code: bool = False,
) -> RunResults:
    """Run a scene to its end and give its results.

    scene: TOML file, or its tables, in which files are relative to the working folder; output: folder of the results,
    the scene's unless given; ranks: started by mpirun, which waits for them; without it the run is in this process, on
    all ranks of an `mpirun` script (then it is collective). options: further words of `parsolid run`. trust_code: laws
    in files that the scene names are run.

    Raises SceneError or SolverError (bad input, told as on the command line), OutputError, RunFailed (the run went
    wrong), on all ranks.
    """
    comm = MPI.COMM_WORLD
    if ranks is not None and comm.size > 1:
        raise SolverError(f"ranks: expected none in a script on {comm.size} ranks, which all take part, found {ranks}")
    more = (*options, "--trust-code") if trust_code else options
    words = parse(["run", *more])
    stated = bcast_scene(comm, lambda: read_scene(scene, words.trust_code, overrides_of(words)))
    folder = Path(output if output is not None else stated.output.directory)
    if ranks is None:
        words.scene, words.output = None if isinstance(scene, dict) else str(scene), str(folder)
        run_scene(comm, stated, words, clock.perf_counter())
    else:
        _in_processes(stated, folder, ranks, more)
    comm.barrier()
    return load(folder)


def read_scene(scene: str | Path | dict[str, Any], trust_code: bool, overrides: Sequence[str] = ()) -> Scene:
    """A scene of a TOML file or of its tables, in which files are relative to the working folder. Raises SceneError.

    overrides: see `load_scene`.
    """
    if not isinstance(scene, dict):
        return load_scene(scene, list(overrides), trust_code)
    tables = copy.deepcopy(scene)
    if faults := [text for text in (apply_override(tables, override) for override in overrides) if text]:
        raise SceneError(faults)
    if isinstance(output := tables.setdefault("output", {}), dict):
        output.setdefault("directory", "results/scene")
    return parse_scene(tables, os.getcwd(), trust_code)


def _in_processes(scene: Scene, folder: Path, ranks: int, options: tuple[str, ...]) -> None:
    """Start a job of its own and wait for it. Raises what its exit status means."""
    with tempfile.TemporaryDirectory() as temporary:
        stated = Path(temporary) / "scene.toml"
        dump_scene(scene, stated)
        job = start(["run", str(stated), "-o", str(folder), *options], ranks, stderr=subprocess.PIPE, text=True)
        try:
            said = job.communicate()[1].strip().removeprefix("parsolid: ")
        except KeyboardInterrupt:
            stop(job)
            job.communicate()
            raise
    # one that was told to stop is done, too, as it is in this process
    if job.returncode in (0, TO_BE_CONTINUED):
        return
    raise {2: SolverError, 3: RunFailed}.get(job.returncode, RuntimeError)(said or f"exit status {job.returncode}")
