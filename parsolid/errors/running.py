"""Runs companions before a run, on its ranks; what is done is kept by digest, what was killed goes on."""

import json
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.collective import SolverError, anywhere
from parsolid.errors.variants import Companion
from parsolid.output.checkpoint import DEFAULT_NAME, find_checkpoint, partial_name, previous_name
from parsolid.output.errors import OutputError, together
from parsolid.output.history import read_history
from parsolid.output.run_folder import RunFolder
from parsolid.scene import Scene, SceneError
from parsolid.simulation.job import FAILED, Job
from parsolid.simulation.loop import FINISHED, Limits, RunFailed, Simulation
from parsolid.simulation.restart import Restart
from parsolid.simulation.signals import REQUEST

FOLDER = "companions"


@dataclass
class Done:
    """A companion that has been run: its history on rank 0, and what it cost; fault: why it has none."""

    companion: Companion
    history: dict[str, np.ndarray]
    core_seconds: float
    processor_seconds: float
    particles: int
    steps: int
    fault: str | None = None

    @property
    def ratio(self) -> float:
        """Spacing over that of the run."""
        return self.companion.ratio


class Interrupted(Exception):
    """A signal or the wall time ended a companion, which left a checkpoint."""


def run_companions(
    comm: MPI.Intracomm, found: list[Companion], folder: Path, limits: Limits, say: Callable[[str], None]
) -> list[Done]:
    """Run all that are not there yet, or go on with them; raises Interrupted on all ranks. Collective."""
    done = []
    for number, one in enumerate(found, 1):
        place = folder / FOLDER / comm.bcast(one.digest if comm.rank == 0 else None)
        result = result_of(comm, one, place)
        if result is None:
            say(f"error bars: companion {number} of {len(found)}, {one.title}")
            try:
                run_into(comm, one.scene, place, limits)
            except (SceneError, SolverError) as error:
                # the scene itself can be set up, as the run will tell if it cannot
                result = Done(one, {}, 0.0, 0.0, 0, 0, f"it cannot be set up: {error}")
            else:
                result = result_of(comm, one, place)
        assert result is not None
        done.append(result)
        if result.fault:
            say(f"error bars: companion {one.title} failed: {result.fault}")
    return done


def result_of(comm: MPI.Intracomm, one: Companion, place: Path) -> Done | None:
    """What a folder holds of a companion that has ended, None where it has not; the history on rank 0. Collective."""
    result = None
    with together(comm, f"cannot read {place}"):
        if comm.rank == 0 and (place / "summary.json").exists():
            summary = json.loads((place / "summary.json").read_text())
            history = {}
            if summary["status"] == FINISHED:
                history = {name: np.array(values) for name, values in read_history(place / "history.csv").items()}
            if summary["status"] in (FINISHED, FAILED):
                costs = core_seconds(summary), seconds_without_loading(summary)
                size = summary["particles"], summary["steps"]
                result = Done(one, history, *costs, *size, summary.get("fault"))
    told = comm.bcast(None if result is None else replace(result, history={}))
    return result if comm.rank == 0 else told


def seconds_without_loading(summary: dict[str, Any]) -> float:
    """Processor time [s] of a run's loop, its first step, which loads kernels, counted as one of the others."""
    return _without_first(summary, summary["loop_processor_seconds"], summary["first_step_processor_seconds"])


def core_seconds(summary: dict[str, Any]) -> float:
    """Wall time [s] of a run's loop times ranks, its first step, which loads kernels, counted as one of the others."""
    return float(summary["ranks"]) * _without_first(summary, summary["loop_seconds"], summary["first_step_seconds"])


def _without_first(summary: dict[str, Any], seconds: float, first: float) -> float:
    steps = summary["steps"]
    return float((seconds - first) * steps / (steps - 1) if steps > 1 and first < seconds else seconds)


def run_into(comm: MPI.Intracomm, scene: Scene, place: Path, limits: Limits) -> None:
    """Run a scene, or go on with it, into a folder. Raises Interrupted. Collective."""
    restart = _restart(comm, place)
    simulation = Simulation(comm, scene, restart)
    with (
        closing(RunFolder(comm, place, restart.path if restart else None)) as folder,
        closing(Job(simulation, folder, restart)) as job,
    ):
        try:
            status = job.run(limits, REQUEST)["status"]
        except RunFailed:
            status = FAILED
    if status not in (FINISHED, FAILED):
        raise Interrupted


def _restart(comm: MPI.Intracomm, place: Path) -> Restart | None:
    """The newest checkpoint of a companion's folder; None where it has none that will do."""
    name = place / DEFAULT_NAME
    there = any(path.exists() for path in (name, partial_name(name), previous_name(name)))
    if not anywhere(comm, there):
        return None
    try:
        return Restart(comm, find_checkpoint(place, comm))
    except OutputError:
        return None
