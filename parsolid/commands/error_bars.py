"""`parsolid run --error-bars`: companions first, then the run, then its bars."""

import json
import time as clock
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpi4py import MPI

from parsolid.collective import anywhere
from parsolid.commands.standard_pictures import draw
from parsolid.errors.bars import ErrorTable, error_table, lines, summary_of_bars
from parsolid.errors.files import NAME, history_of, write_error_columns
from parsolid.errors.places import Corners
from parsolid.errors.running import FOLDER, Done, Interrupted, run_companions, seconds_without_loading
from parsolid.errors.variants import Companion, companions_of
from parsolid.output.checkpoint import DEFAULT_NAME, partial_name, previous_name
from parsolid.output.errors import together
from parsolid.output.log import aloud
from parsolid.output.summary import write_summary
from parsolid.scene import Scene
from parsolid.simulation.loop import Limits

Alone = Callable[[MPI.Intracomm, Scene, Namespace, float], int]


def run_with_bars(comm: MPI.Intracomm, scene: Scene, options: Namespace, began: float, alone: Alone) -> int:
    """Run companions and a scene, and tell the bars; the exit status. alone: what runs a scene. Collective."""
    folder = Path(options.output or scene.output.directory)
    say = speaker(comm, options)
    plans, refused = companions_of(scene, options.trust_code, (scene.errors.ratios if scene.errors else None) or ())
    for reason in refused:
        say(f"error bars: {reason}")
    done = companions_done(comm, plans, folder, options, began, say)
    if done is None:
        return 75
    without_checkpoint(comm, options, folder)
    status = alone(comm, scene, options, began)
    if status:
        say("error bars: at the end of the run, which the same command goes on with when --restart is added")
        return status
    with together(comm, f"cannot write the error bars of {folder}"):
        if comm.rank == 0:
            table, _ = write_bars(scene, folder, done, refused)
            extra = extra_time(folder, done)
            for line in lines(table, scene, extra):
                say(line)
    if scene.output.pictures:
        draw(comm, folder)
    return status


def speaker(comm: MPI.Intracomm, options: Namespace) -> Callable[[str], None]:
    """What prints lines on rank 0, unless the run is quiet."""

    def say(text: str) -> None:
        if comm.rank == 0 and not options.quiet:
            aloud(text)

    return say


def companions_done(
    comm: MPI.Intracomm,
    plans: list[Companion],
    folder: Path,
    options: Namespace,
    began: float,
    say: Callable[[str], None],
) -> list[Done] | None:
    """Companions that have been run; None when a signal or the wall time ended one. Collective."""
    limits = Limits(None, None if options.wall_time is None else began + options.wall_time)
    try:
        return run_companions(comm, plans, folder, limits, say)
    except Interrupted:
        say(f"stopped in a companion, which is kept in {folder / FOLDER}: the same command goes on")
        return None


def without_checkpoint(comm: MPI.Intracomm, options: Namespace, folder: Path) -> None:
    """A run to be continued that was stopped in its companions has nothing to continue from, and starts. Collective."""
    name = folder / DEFAULT_NAME
    there = any(path.exists() for path in (name, partial_name(name), previous_name(name)))
    if options.restart == "" and not anywhere(comm, there):
        options.restart = None


def write_bars(
    scene: Scene, folder: Path, done: list[Done], refused: list[str], corners: tuple[Corners, ...] = ()
) -> tuple[ErrorTable, dict[str, Any]]:
    """Make the bars of a run in its folder and write them beside its history and into its summary; corners: see
    `error_table`; for one rank."""
    table = error_table(scene, history_of(folder), done, corners)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    told = summary_of_bars(table, scene, done, refused) | {"extra_time": extra_time(folder, done)}
    write_summary(folder / "summary.json", summary | {"error_bars": told})
    if table.bars:
        write_error_columns(folder / NAME, table)
    return table, told


def extra_time(folder: Path, done: list[Done]) -> float | None:
    """Processor time of the companions over that of the run, both without loading kernels; for one rank."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    own = seconds_without_loading(summary)
    return sum(one.processor_seconds for one in done) / own if own > 0.0 else None


def now() -> float:
    """Reading of the performance counter [s]."""
    return clock.perf_counter()
