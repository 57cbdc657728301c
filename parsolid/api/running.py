"""Whole runs: a scene into a folder, with the error bars, targets and pictures that are asked for."""

import gc
import subprocess
import tempfile
import time as clock
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from parsolid.api.check_advice import scene_advice, size_advice, thin_advice
from parsolid.api.pictures import draw_at_end
from parsolid.api.scenes import (
    AnyScene,
    read_scene,
    require_seconds,
    require_texts,
    require_whole_number,
    scene_on_all_ranks,
)
from parsolid.collective import SolverError, anywhere
from parsolid.contact.report import describe_contacts
from parsolid.exit_status import BAD_INPUT, DONE, NOT_REACHED, TO_BE_CONTINUED, WENT_WRONG
from parsolid.kernel_cache import cache_folder, wanted_folder
from parsolid.kernels import on_compile
from parsolid.launcher import start, stop
from parsolid.output.checkpoint import find_checkpoint
from parsolid.output.errors import OutputError, together
from parsolid.output.log import LOG, print_line
from parsolid.output.progress import NORMAL, QUIET, Compilations, Progress
from parsolid.output.results import Results, load
from parsolid.output.run_folder import RunFolder, occupy
from parsolid.scene import Scene, dump_scene
from parsolid.scene.codes import Note
from parsolid.scene.declared import law_files
from parsolid.scene.shapes import MeshFile
from parsolid.simulation.job import Job
from parsolid.simulation.loop import FINISHED, INTERRUPTED, Limits, RunFailed, Simulation
from parsolid.simulation.restart import Restart
from parsolid.simulation.signals import REQUEST
from parsolid.simulation.warmup import warm_up

# functions of a table
SHOWN = 60


@contextmanager
def profiled(comm: Any, folder: Path | None) -> Iterator[None]:
    """Write DIR/profile-RANK.txt, one file a rank, of what is done meanwhile; None: nothing is watched. Collective.

    Time in a compiled kernel counts as own time of the function that calls it. Raises OutputError on all ranks when a
    file cannot be written.
    """
    if folder is None:
        yield
        return
    import cProfile
    import io
    import pstats

    profile = cProfile.Profile()
    profile.enable()
    try:
        yield
    finally:
        profile.disable()
    path = folder / f"profile-{comm.rank}.txt"
    with together(comm, f"cannot write {path}"):
        text = io.StringIO()
        for order, meaning in (("tottime", "own time"), ("cumulative", "time with what they call")):
            text.write(f"rank {comm.rank} of {comm.size}: functions by {meaning}\n")
            pstats.Stats(profile, stream=text).strip_dirs().sort_stats(order).print_stats(SHOWN)
        path.write_text(text.getvalue(), encoding="utf-8")


# a restart from the newest checkpoint of the folder
NEWEST = ""


@dataclass(frozen=True)
class RunOptions:
    """What a run is asked for besides its scene.

    restart: a checkpoint, NEWEST of the folder, or None for a new run; allow_change: keys of the scene that may differ
    from those of the checkpoint; max_steps: steps to stop after; wall_time: seconds after which the run writes a
    checkpoint and stops; error_bars: also estimate the errors of all columns; target: how small error bars shall be;
    core_seconds: what that may take; trust_code: laws in files are run; level: of what is printed, see
    `output.progress`; profile: write which functions take the time; inputs: files that must not be written
    over; silence: codes of warnings and notes that are not printed.
    """

    restart: str | None = None
    allow_change: Sequence[str] = ()
    max_steps: int | None = None
    wall_time: float | None = None
    error_bars: bool = False
    target: Sequence[str] = ()
    core_seconds: float | None = None
    trust_code: bool = False
    level: int = NORMAL
    profile: bool = False
    inputs: Sequence[str] = ()
    silence: Sequence[str] = ()

    def words(self) -> list[str]:
        """The same as options of `parsolid run`."""
        values = {"--max-steps": self.max_steps, "--wall-time": self.wall_time, "--core-seconds": self.core_seconds}
        words = [word for name, value in values.items() if value is not None for word in (name, str(value))]
        words += [word for key in self.allow_change for word in ("--allow-change", key)]
        words += [word for target in self.target for word in ("--target", target)]
        words += [word for code in self.silence for word in ("--silence", code)]
        switches = {"--error-bars": self.error_bars, "--trust-code": self.trust_code, "--quiet": self.level == QUIET}
        words += [name for name, on in (switches | {"--profile": self.profile}).items() if on]
        return [*words, *([] if self.restart is None else ["--restart", *filter(None, [self.restart])])]


def run(
    scene: AnyScene,
    output: str | Path | None = None,
    ranks: int | None = None,
    *,
    overrides: Sequence[str] = (),
    restart: bool | str | Path | None = False,
    allow_change: Sequence[str] = (),
    max_steps: int | None = None,
    wall_time: float | None = None,
    error_bars: bool = False,
    target: Sequence[str] = (),
    core_seconds: float | None = None,
    quiet: bool = True,
    trust_code: bool = False,
) -> Results:
    """Run a scene to its end and give its results; with targets those of the last level, with a warning where it does
    not reach them.

    scene: a Scene, a TOML file, or tables, in which files are relative to the working folder; output: folder of the
    results, the scene's unless given; ranks: started by mpirun, which waits for them; without it the run is in this
    process, on all ranks of an `mpirun` script (then it is collective). overrides: "key.path=value". restart: True goes
    on from the newest checkpoint of the folder, a file from that one. The rest as in `RunOptions`.

    Raises SceneError or SolverError (bad input, told as on the command line), OutputError, RunFailed (the run went
    wrong), on all ranks.
    """
    comm, began = MPI.COMM_WORLD, clock.perf_counter()
    if ranks is not None and comm.size > 1:
        raise SolverError(f"ranks: expected none in a script on {comm.size} ranks, which all take part, found {ranks}")
    for name, number in (("ranks", ranks), ("max_steps", max_steps)):
        if number is not None:
            require_whole_number(name, number)
    for name, seconds in (("wall_time", wall_time), ("core_seconds", core_seconds)):
        if seconds is not None:
            require_seconds(name, seconds)
    for name, words in (("overrides", overrides), ("target", target), ("allow_change", allow_change)):
        require_texts(name, words)
    newest = NEWEST if restart is True else None
    options = RunOptions(
        restart=newest if isinstance(restart, bool) or restart is None else str(restart),
        allow_change=tuple(allow_change),
        max_steps=max_steps,
        wall_time=wall_time,
        error_bars=error_bars,
        target=tuple(target),
        core_seconds=core_seconds,
        trust_code=trust_code,
        level=QUIET if quiet else NORMAL,
        inputs=(str(scene),) if isinstance(scene, str | Path) else (),
    )
    stated = scene_on_all_ranks(comm, lambda: read_scene(scene, overrides, trust_code))
    folder = Path(output if output is not None else stated.output.directory)
    if ranks is None:
        status = run_scene(comm, stated, folder, options, began)
    else:
        status = _in_processes(stated, folder, ranks, options)
    comm.barrier()
    if options.target or (stated.run and stated.run.target):
        folder = comm.bcast(_last_level(folder) if comm.rank == 0 else None)
        if status == NOT_REACHED:
            warnings.warn(f"target: not reached; these are the results of the last level, {folder}", stacklevel=2)
    return load(folder)


def _last_level(folder: Path) -> Path:
    """Where the last level of a search for targets has its results; the folder itself where no level has ended."""
    ended = sorted(folder.glob("levels/*/summary.json"), key=lambda path: path.stat().st_mtime)
    return ended[-1].parent if ended else folder


def _in_processes(scene: Scene, folder: Path, ranks: int, options: RunOptions) -> int:
    """Start a job of its own and wait for it; its exit status. Raises what that means where it is an error."""
    with tempfile.TemporaryDirectory() as temporary:
        stated = Path(temporary) / "scene.toml"
        dump_scene(scene, stated)
        words = ["run", str(stated), "-o", str(folder), *options.words()]
        job = start(words, ranks, stderr=subprocess.PIPE, text=True)
        try:
            said = job.communicate()[1].strip().removeprefix("parsolid: ")
        except KeyboardInterrupt:
            stop(job)
            job.communicate()
            raise
    # one that was told to stop is done, too, as it is in this process
    if job.returncode in (DONE, TO_BE_CONTINUED, NOT_REACHED):
        return job.returncode
    raise {BAD_INPUT: SolverError, WENT_WRONG: RunFailed}.get(job.returncode, RuntimeError)(
        said or f"exit status {job.returncode}"
    )


def run_scene(comm: MPI.Intracomm, scene: Scene, folder: Path, options: RunOptions, began: float) -> int:
    """Run a scene into a folder with all that is asked for, in this process; the exit status that says how it ended.

    began: reading of the performance counter from which the wall time counts [s]. Collective.
    """
    target = options.target or (scene.run.target if scene.run else [])
    error_bars = options.error_bars or scene.errors is not None
    if not target and not error_bars:
        return run_alone(comm, scene, folder, options, began, pictures=True)
    status = _run_campaign(comm, scene, folder, options, target, began)
    if status == DONE and not target:
        draw_at_end(comm, folder, scene.output.pictures, clock.perf_counter() - began, options.level == QUIET)
    return status


def _run_campaign(
    comm: MPI.Intracomm, scene: Scene, folder: Path, options: RunOptions, target: Sequence[str], began: float
) -> int:
    """Error bars of a scene, or levels of it until targets are reached; the exit status. Collective."""
    from parsolid.campaign.error_bars import Campaign, run_with_error_bars
    from parsolid.campaign.in_process import has_checkpoint
    from parsolid.campaign.targets import run_to_targets
    from parsolid.particles.generation import generate

    limits = Limits(None, None if options.wall_time is None else began + options.wall_time)

    def alone(scene: Scene, folder: Path) -> int:
        own = replace(options, restart=NEWEST, level=QUIET) if target else options
        if own.restart == NEWEST and not has_checkpoint(comm, folder):
            # it was stopped in its coarse runs: there is nothing to go on with
            own = replace(own, restart=None)
        # of the run before this one: systems have references to themselves, and are large
        gc.collect()
        return run_alone(comm, scene, folder, own, began)

    def say(text: str) -> None:
        if comm.rank == 0 and options.level != QUIET:
            print_line(text)

    # refuses bodies that touch and that no table names, which coarser runs keep apart (`CoarserScene`)
    generate(scene, comm)
    campaign = Campaign(comm, folder, options.trust_code, limits, say, alone)
    if target:
        stated = scene.run.core_seconds if scene.run else None
        return run_to_targets(campaign, scene, list(target), options.core_seconds or stated)
    return run_with_error_bars(campaign, scene)


def run_alone(
    comm: MPI.Intracomm, scene: Scene, folder: Path, options: RunOptions, began: float, pictures: bool = False
) -> int:
    """Run one scene into a folder without runs beside it; the exit status. Collective."""
    with ExitStack() as kept:
        if comm.rank == 0 and options.level != QUIET:
            kept.enter_context(on_compile(Compilations(cache_folder(), wanted_folder())))
        try:
            simulation, files, restart = _set_up(comm, scene, folder, options, kept)
        except OutputError as error:
            # a folder that cannot be written or a checkpoint that cannot be read is bad input
            raise SolverError(str(error)) from error
        _announce(simulation, files, restart, options)
        job = kept.enter_context(closing(Job(simulation, files, restart, _progress(simulation, options))))
        limits = Limits(options.max_steps, None if options.wall_time is None else began + options.wall_time)
        with profiled(comm, files.directory if options.profile else None):
            status = job.run(limits, REQUEST)["status"]
        if pictures and status == FINISHED:
            taken = clock.perf_counter() - began
            draw_at_end(comm, files.directory, scene.output.pictures, taken, options.level == QUIET)
    return TO_BE_CONTINUED if status == INTERRUPTED else DONE


def _set_up(
    comm: MPI.Intracomm, scene: Scene, directory: Path, options: RunOptions, kept: ExitStack
) -> tuple[Simulation, RunFolder, Restart | None]:
    """Simulation, folder and restart (or None); nothing is written before the scene is known to be sound. Collective.

    kept: gives the lock on the folder back when it is left.
    """
    restart, lock = None, None
    if options.restart is not None:
        # before the checkpoint is read, so that no other run goes on from it or writes the next one
        lock = occupy(comm, directory) if anywhere(comm, directory.is_dir()) else None
        if lock is not None:
            kept.callback(lock.release)
        path = Path(options.restart) if options.restart else find_checkpoint(directory, comm)
        restart = Restart(comm, path, tuple(options.allow_change))
    elif options.allow_change:
        raise SolverError(f"--allow-change {options.allow_change[0]}: expected --restart with it, found none")
    started = clock.perf_counter()
    warm_up(comm, scene)
    simulation = Simulation(comm, scene, restart)
    # whoever waits waits for the kernels, too
    simulation.clock.began = started
    meshes = tuple(body.shape.model.file for body in scene.bodies if isinstance(body.shape.model, MeshFile))
    series = (scene.reference.series,) if scene.reference and scene.reference.series else ()
    # what the run reads, and must not write over
    inputs = (*options.inputs, *meshes, *series, *law_files(scene), *((restart.path,) if restart else ()))
    folder = RunFolder(comm, directory, restart.path if restart else None, inputs, lock)
    kept.callback(folder.close)
    return simulation, folder, restart


def _announce(simulation: Simulation, folder: RunFolder, restart: Restart | None, options: RunOptions) -> None:
    """Print warnings and notes on a run that is about to begin; collective."""
    advised = size_advice(simulation) + thin_advice(simulation)
    advised += [note for system in simulation.systems for note in system.cost_notes()]
    advised += describe_contacts(simulation.comm, simulation.scene, simulation.systems)
    if simulation.comm.rank > 0:
        return
    moved = [Note("results-moved", f"the results of an earlier run are in {aside} now") for aside in folder.moved]
    notes = [*moved, *scene_advice(simulation.scene), *(restart.notes if restart else ()), *advised]
    for line in (str(one) for one in (*simulation.warnings, *notes) if one.code not in options.silence):
        LOG.say(line)
        if options.level != QUIET:
            print_line(line)


def _progress(simulation: Simulation, options: RunOptions) -> list[Progress]:
    """Lines of progress, on the terminal and in the log; of rank 0."""
    if simulation.comm.rank > 0:
        return []
    streams = [(options.level, None), (NORMAL, LOG.stream)][: 1 + (LOG.stream is not None)]
    return [
        Progress(simulation.scene.title, simulation.scene.end_time, simulation.particles, *stream) for stream in streams
    ]
