"""The commands `run` and `check`."""

import time as clock
from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack, closing
from pathlib import Path

from mpi4py import MPI

from parsolid.collective import SolverError, anywhere
from parsolid.commands.check_advice import advice, cost_advice, scene_advice, size_advice, thin_advice
from parsolid.commands.profiling import profiled
from parsolid.commands.standard_pictures import draw
from parsolid.contact.report import describe_contacts
from parsolid.kernel_cache import cache_folder, wanted_folder
from parsolid.kernels import on_compile
from parsolid.output.checkpoint import find_checkpoint
from parsolid.output.directory import occupy
from parsolid.output.errors import OutputError
from parsolid.output.log import LOG, aloud
from parsolid.output.progress import NORMAL, QUIET, VERBOSE, Compilations, Progress
from parsolid.output.run_folder import RunFolder
from parsolid.output.summary import peak_memory_bytes
from parsolid.scene import Scene, SceneError, load_scene, packaged_scene
from parsolid.scene.declared import law_files
from parsolid.scene.shapes import MeshFile
from parsolid.simulation.job import Job
from parsolid.simulation.loop import FINISHED, INTERRUPTED, Limits, Simulation
from parsolid.simulation.restart import Restart
from parsolid.simulation.signals import REQUEST
from parsolid.simulation.warmup import load_kernels, warm_up

TO_BE_CONTINUED = 75


def bcast_scene(comm: MPI.Intracomm, read: Callable[[], Scene]) -> Scene:
    """What rank 0 alone reads, the same on all ranks. Raises SceneError on all ranks."""
    scene = error = None
    if comm.rank == 0:
        try:
            scene = read()
        except SceneError as found:
            error = found.faults
    known: Scene
    known, error = comm.bcast((scene, error))
    if error is not None:
        raise SceneError(error)
    return known


def load(comm: MPI.Intracomm, options: Namespace) -> Scene:
    """The scene of a command line, read by rank 0 alone; the same on all ranks. Raises SceneError on all ranks."""
    path = _stated_scene(options)
    return bcast_scene(comm, lambda: _load(path, overrides_of(options), options))


def overrides_of(options: Namespace) -> list[str]:
    """What a command line changes in a scene, as "key.path=value"."""
    end = [] if options.end_time is None else [f"end_time={options.end_time!r}"]
    return [*options.set, *end]


def _stated_scene(options: Namespace) -> Path | str:
    """The scene's file: the one that is named, that of the run which is continued, or the packaged one."""
    restart = getattr(options, "restart", None)
    if options.scene is None and restart and restart.endswith(".toml"):
        # "--restart SCENE": the words stand in the other order
        options.scene, options.restart = restart, ""
    elif options.scene is None and (restart or (restart is not None and options.output)):
        folder = Path(restart).parent if restart else Path(options.output)
        options.output = options.output or str(folder)
        return folder / "scene.toml"
    return packaged_scene() if options.scene is None else options.scene


def _load(path: Path | str, overrides: list[str], options: Namespace) -> Scene:
    """For one rank. Raises SceneError."""
    restart = getattr(options, "restart", None)
    if options.scene is None and restart and not Path(restart).is_file():
        raise SceneError([f"--restart {restart}: expected a checkpoint, found no such file"])
    if options.scene is None and restart is not None and not Path(path).is_file():
        raise SceneError([f"{path}: expected the scene of the run to go on with, found none"])
    return load_scene(path, overrides, options.trust_code)


def run(comm: MPI.Intracomm, options: Namespace) -> int:
    """Run a scene to its end; the exit status. Collective."""
    began = clock.perf_counter()
    REQUEST.install()
    try:
        LOG.open(comm, options.log)
    except OutputError as error:
        raise SolverError(str(error)) from error
    return run_scene(comm, load(comm, options), options, began)


def run_scene(comm: MPI.Intracomm, scene: Scene, options: Namespace, began: float) -> int:
    """Run a scene with the options of a command line; began: reading of the performance counter [s]. Collective."""
    requested = options.target or (scene.run.target if scene.run else [])
    if not requested and not _has_error_bars(scene, options):
        return run_alone(comm, scene, options, began)
    from parsolid.campaign.error_bars import Campaign, run_with_error_bars
    from parsolid.campaign.runner import has_checkpoint
    from parsolid.campaign.targets import run_to_targets

    limits = Limits(None, None if options.wall_time is None else began + options.wall_time)

    def alone(scene: Scene, folder: Path) -> int:
        words = Namespace(**vars(options) | {"output": str(folder)})
        if requested:
            words.restart, words.quiet = "", True
        if words.restart == "" and not has_checkpoint(comm, folder):
            # it was stopped in its coarse runs: there is nothing to go on with
            words.restart = None
        return run_alone(comm, scene, words, began)

    def say(text: str) -> None:
        if comm.rank == 0 and not options.quiet:
            aloud(text)

    folder = Path(options.output or scene.output.directory)
    campaign = Campaign(comm, folder, options.trust_code, limits, say, alone)
    if requested:
        stated = scene.run.core_seconds if scene.run else None
        return run_to_targets(campaign, scene, requested, options.core_seconds or stated)
    status = run_with_error_bars(campaign, scene)
    if status == 0 and scene.output.pictures:
        draw(comm, folder)
    return status


def _has_error_bars(scene: Scene, options: Namespace) -> bool:
    return options.error_bars or scene.errors is not None


def run_alone(comm: MPI.Intracomm, scene: Scene, options: Namespace, began: float) -> int:
    """The same without anything beside the run. Collective."""
    with ExitStack() as kept:
        if comm.rank == 0 and not options.quiet:
            kept.enter_context(on_compile(Compilations(cache_folder(), wanted_folder())))
        try:
            simulation, folder, restart = _set_up(comm, scene, options, kept)
        except OutputError as error:
            # a folder that cannot be written or a checkpoint that cannot be read is bad input
            raise SolverError(str(error)) from error
        _announce(simulation, folder, restart, options)
        job = kept.enter_context(closing(Job(simulation, folder, restart, _progress(simulation, options))))
        limits = Limits(options.max_steps, None if options.wall_time is None else began + options.wall_time)
        with profiled(comm, folder.directory if options.profile else None):
            status = job.run(limits, REQUEST)["status"]
        if status == FINISHED and scene.output.pictures and not _has_error_bars(scene, options):
            draw(comm, folder.directory)
    return TO_BE_CONTINUED if status == INTERRUPTED else 0


def _set_up(
    comm: MPI.Intracomm, scene: Scene, options: Namespace, kept: ExitStack
) -> tuple[Simulation, RunFolder, Restart | None]:
    """Simulation, folder and restart (or None); nothing is written before the scene is known to be sound. Collective.

    kept: gives the lock on the folder back when it is left.
    """
    directory = Path(options.output or scene.output.directory)
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
    folder = RunFolder(comm, directory, restart.path if restart else None, _inputs(options, scene, restart), lock)
    kept.callback(folder.close)
    return simulation, folder, restart


def _announce(simulation: Simulation, folder: RunFolder, restart: Restart | None, options: Namespace) -> None:
    """Print warnings and notes on a run that is about to begin; collective."""
    advised = size_advice(simulation) + thin_advice(simulation) + cost_advice(simulation)
    advised += describe_contacts(simulation.comm, simulation.scene, simulation.systems)
    if simulation.comm.rank > 0:
        return
    moved = [f"the results of an earlier run are in {aside} now" for aside in folder.moved]
    notes = [*moved, *scene_advice(simulation.scene), *(restart.notes if restart else ()), *advised]
    for line in (*map(str, simulation.warnings), *(f"note: {note}" for note in notes)):
        LOG.say(line)
        if not options.quiet:
            aloud(line)


def _progress(simulation: Simulation, options: Namespace) -> list[Progress]:
    """Lines of progress, on the terminal and in the log; of rank 0."""
    if simulation.comm.rank > 0:
        return []
    level = QUIET if options.quiet else VERBOSE if options.verbose else NORMAL
    streams = [(level, None), (NORMAL, LOG.stream)][: 1 + (LOG.stream is not None)]
    return [
        Progress(simulation.scene.title, simulation.scene.end_time, simulation.particles, *stream) for stream in streams
    ]


def _inputs(options: Namespace, scene: Scene, restart: Restart | None) -> tuple[Path | str, ...]:
    """Files that the run reads and must not write over."""
    meshes = tuple(body.shape.model.file for body in scene.bodies if isinstance(body.shape.model, MeshFile))
    series = (scene.reference.series,) if scene.reference and scene.reference.series else ()
    named = (options.scene,) if options.scene else ()
    return named + meshes + series + tuple(law_files(scene)) + ((restart.path,) if restart else ())


def check(comm: MPI.Intracomm, options: Namespace) -> int:
    """Set a scene up and print what it costs; exit status 0. Collective."""
    from parsolid.commands.report import print_report

    scene = load(comm, options)
    warm_up(comm, scene)
    elsewhere, base, idle = getattr(options, "ranks", None), 0, 0.0
    if elsewhere:
        # what the program takes once its kernels are there
        idle = load_kernels(scene)
        base = peak_memory_bytes(present=True)
    simulation = Simulation(comm, scene)
    notes = advice(simulation)
    print_report(comm, simulation, elsewhere, base, idle)
    for line in (*map(str, simulation.warnings), *(f"note: {note}" for note in notes)) if comm.rank == 0 else ():
        print(line, flush=True)
    return 0
