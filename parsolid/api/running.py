"""Complete runs of scenes, with requested error bars, targets and pictures."""

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

# number of functions in a profile
SHOWN = 60


@contextmanager
def profiled(comm: Any, folder: Path | None) -> Iterator[None]:
    """Profile the body of the `with` statement into DIR/profile-RANK.txt; no profile if the folder is None. Collective.

    The time of a compiled kernel counts as own time of its caller. Raises OutputError on all ranks if a file cannot be
    written.
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


# value of `restart` for the newest checkpoint of the folder
NEWEST = ""


@dataclass(frozen=True)
class RunOptions:
    """Options of a run besides its scene.

    restart: a checkpoint, NEWEST, or None for a new run; allow_change: keys of the scene that may differ from those of
    the checkpoint; max_steps: stop after so many steps; wall_time: write a checkpoint and stop after this time [s];
    error_bars: estimate the errors of all columns; target: requested error bars, "column=bar"; core_seconds: limit for
    targets; trust_code: execute files of laws; level: of printed messages, see `output.progress`; profile: write
    profiles of functions; inputs: files that must not be overwritten; silence: codes of warnings and notes that are not
    printed
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
        """The options as arguments of `parsolid run`."""
        values = {"--max-steps": self.max_steps, "--wall-time": self.wall_time, "--core-seconds": self.core_seconds}
        words = [word for name, value in values.items() if value is not None for word in (name, str(value))]
        words += [word for key in self.allow_change for word in ("--allow-change", key)]
        words += [word for target in self.target for word in ("--target", target)]
        words += [word for code in self.silence for word in ("--silence", code)]
        switches = {"--error-bars": self.error_bars, "--trust-code": self.trust_code, "--quiet": self.level == QUIET}
        words += [name for name, on in (switches | {"--profile": self.profile}).items() if on]
        if self.restart is not None:
            words.append("--restart")
            if self.restart != NEWEST:
                words.append(self.restart)
        return words


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
    """Run a scene to its end and return its results; with targets those of the last level, with a warning if it does
    not reach them.

    scene: a Scene, a TOML file, or tables, in which files are relative to the working folder; output: folder of the
    results (default: of the scene); ranks: run on so many ranks started by mpirun; without it the run is in this
    process, on all ranks of an `mpirun` script (collective); overrides: "key.path=value"; restart: True for the newest
    checkpoint of the folder, or a checkpoint file. Other arguments are those of `RunOptions`.

    Raises SceneError or SolverError (bad input), OutputError or RunFailed (the run went wrong) on all ranks.
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
        if comm.rank == 0:
            # the level that ended last, if any
            ended = sorted(folder.glob("levels/*/summary.json"), key=lambda path: path.stat().st_mtime)
            folder = ended[-1].parent if ended else folder
        folder = comm.bcast(folder)
        if status == NOT_REACHED:
            warnings.warn(f"target: not reached; these are the results of the last level, {folder}", stacklevel=2)
    return load(folder)


def _in_processes(scene: Scene, folder: Path, ranks: int, options: RunOptions) -> int:
    """Run a scene on ranks started by mpirun; the exit status. Raises SolverError, RunFailed or RuntimeError."""
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "scene.toml"
        dump_scene(scene, path)
        words = ["run", str(path), "-o", str(folder), *options.words()]
        job = start(words, ranks, stderr=subprocess.PIPE, text=True)
        try:
            message = job.communicate()[1].strip().removeprefix("parsolid: ")
        except KeyboardInterrupt:
            stop(job)
            job.communicate()
            raise
    if job.returncode in (DONE, TO_BE_CONTINUED, NOT_REACHED):
        return job.returncode
    error = {BAD_INPUT: SolverError, WENT_WRONG: RunFailed}.get(job.returncode, RuntimeError)
    raise error(message or f"exit status {job.returncode}")


def run_scene(comm: MPI.Intracomm, scene: Scene, folder: Path, options: RunOptions, began: float) -> int:
    """Run a scene into a folder in this process, with error bars or targets if requested; the exit status. Collective.

    began: time of the performance counter [s] at which the wall time begins
    """
    target = options.target or (scene.run.target if scene.run else [])
    error_bars = options.error_bars or scene.errors is not None
    if target and options.error_bars:
        raise SolverError("--error-bars: expected no --target with it, whose runs have error bars, found both")
    if target and options.max_steps is not None:
        raise SolverError(f"--max-steps: expected no --target with it, found {options.max_steps}")
    if not target and not error_bars:
        return run_alone(comm, scene, folder, options, began, pictures=True)
    status = _run_campaign(comm, scene, folder, options, target, began)
    if status == DONE and not target:
        draw_at_end(comm, folder, scene.output.pictures, clock.perf_counter() - began, options.level == QUIET)
    return status


def _run_campaign(
    comm: MPI.Intracomm, scene: Scene, folder: Path, options: RunOptions, target: Sequence[str], began: float
) -> int:
    """Run a scene with error bars, or levels of it until targets are reached; the exit status. Collective."""
    from parsolid.campaign.error_bars import Campaign, run_with_error_bars
    from parsolid.campaign.in_process import has_checkpoint
    from parsolid.campaign.targets import run_to_targets
    from parsolid.particles.generation import generate

    limits = Limits(None, None if options.wall_time is None else began + options.wall_time)

    def run_one(scene: Scene, folder: Path) -> int:
        own_options = replace(options, restart=NEWEST, level=QUIET) if target else options
        if own_options.restart == NEWEST and not has_checkpoint(comm, folder):
            # the previous command was stopped in its coarse runs
            own_options = replace(own_options, restart=None)
        # frees the systems of the previous run, which hold reference cycles and large arrays
        gc.collect()
        return run_alone(comm, scene, folder, own_options, began)

    def say(text: str) -> None:
        if comm.rank == 0 and options.level != QUIET:
            print_line(text)

    # refuses touching bodies that no table names; coarser runs do not see them (`CoarserScene`)
    generate(scene, comm)
    try:
        lock = occupy(comm, folder)
    except OutputError as error:
        raise SolverError(str(error)) from error
    if lock is not None:
        lock.release()
    campaign = Campaign(comm, folder, options.trust_code, limits, say, run_one)
    if target:
        limit = options.core_seconds or (scene.run.core_seconds if scene.run else None)
        return run_to_targets(campaign, scene, list(target), limit)
    return run_with_error_bars(campaign, scene)


def run_alone(
    comm: MPI.Intracomm, scene: Scene, folder: Path, options: RunOptions, began: float, pictures: bool = False
) -> int:
    """Run one scene into a folder, without error bars or targets; the exit status. Collective."""
    with ExitStack() as resources:
        if comm.rank == 0 and options.level != QUIET:
            resources.enter_context(on_compile(Compilations(cache_folder(), wanted_folder())))
        try:
            simulation, files, restart = _set_up(comm, scene, folder, options, resources)
        except OutputError as error:
            # a folder that cannot be written or a checkpoint that cannot be read is bad input
            raise SolverError(str(error)) from error
        _announce(simulation, files, restart, options)
        job = resources.enter_context(closing(Job(simulation, files, restart, _progress(simulation, options))))
        limits = Limits(options.max_steps, None if options.wall_time is None else began + options.wall_time)
        with profiled(comm, files.directory if options.profile else None):
            status = job.run(limits, REQUEST)["status"]
        if pictures and status == FINISHED:
            taken = clock.perf_counter() - began
            draw_at_end(comm, files.directory, scene.output.pictures, taken, options.level == QUIET)
    return TO_BE_CONTINUED if status == INTERRUPTED else DONE


def _set_up(
    comm: MPI.Intracomm, scene: Scene, directory: Path, options: RunOptions, resources: ExitStack
) -> tuple[Simulation, RunFolder, Restart | None]:
    """Simulation, folder and restart; nothing is written before the scene is set up. Collective.

    resources: releases the lock on the folder and the folder on exit
    """
    restart, lock = None, None
    if options.restart is not None:
        # locked before the checkpoint is read, so that no other run continues from it or replaces it
        lock = occupy(comm, directory) if anywhere(comm, directory.is_dir()) else None
        if lock is not None:
            resources.callback(lock.release)
        path = Path(options.restart) if options.restart else find_checkpoint(directory, comm)
        restart = Restart(comm, path, tuple(options.allow_change))
    elif options.allow_change:
        raise SolverError(f"--allow-change {options.allow_change[0]}: expected --restart with it, found none")
    started = clock.perf_counter()
    warm_up(comm, scene)
    simulation = Simulation(comm, scene, restart)
    # the wall time includes the compilation of kernels
    simulation.clock.began = started
    # files that the run reads and must not overwrite
    inputs: list[str | Path] = [*options.inputs, *law_files(scene)]
    inputs += [body.shape.model.file for body in scene.bodies if isinstance(body.shape.model, MeshFile)]
    if scene.reference and scene.reference.series:
        inputs.append(scene.reference.series)
    if restart:
        inputs.append(restart.path)
    folder = RunFolder(comm, directory, restart.path if restart else None, tuple(inputs), lock)
    resources.callback(folder.close)
    return simulation, folder, restart


def _announce(simulation: Simulation, folder: RunFolder, restart: Restart | None, options: RunOptions) -> None:
    """Print warnings and notes before a run; collective."""
    # advice that all ranks compute together
    advice = size_advice(simulation) + thin_advice(simulation)
    advice += [note for system in simulation.systems for note in system.cost_notes()]
    advice += describe_contacts(simulation.comm, simulation.scene, simulation.systems)
    if simulation.comm.rank > 0:
        return
    moved = [Note("results-moved", f"the results of an earlier run are in {aside} now") for aside in folder.moved]
    notes = [*moved, *scene_advice(simulation.scene), *(restart.notes if restart else ()), *advice]
    for note in (*simulation.warnings, *notes):
        if note.code not in options.silence:
            LOG.say(str(note))
            if options.level != QUIET:
                print_line(str(note))


def _progress(simulation: Simulation, options: RunOptions) -> list[Progress]:
    """Progress lines for the terminal and the log; on rank 0."""
    if simulation.comm.rank > 0:
        return []
    about = simulation.scene.title, simulation.scene.end_time, simulation.particles
    lines = [Progress(*about, options.level, None)]
    if LOG.stream is not None:
        lines.append(Progress(*about, NORMAL, LOG.stream))
    return lines
