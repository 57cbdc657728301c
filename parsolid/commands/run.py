"""The commands `run` and `check`."""

import time as clock
from argparse import Namespace
from pathlib import Path

from mpi4py import MPI

from parsolid.api.running import RunOptions, run_scene
from parsolid.api.scenes import scene_on_all_ranks
from parsolid.collective import SolverError
from parsolid.output.errors import OutputError
from parsolid.output.log import LOG
from parsolid.output.progress import NORMAL, QUIET, VERBOSE
from parsolid.scene import Scene, SceneError, load_scene, packaged_scene
from parsolid.simulation.signals import REQUEST


def load(comm: MPI.Intracomm, options: Namespace) -> Scene:
    """The scene of a command line, read by rank 0, on all ranks. Raises SceneError on all ranks."""
    path = _scene_file(options)
    return scene_on_all_ranks(comm, lambda: _load(path, options))


def _scene_file(options: Namespace) -> Path | str:
    """The scene's file: the named one, that of the continued run, or that of the package."""
    restart = getattr(options, "restart", None)
    if options.scene is None and restart and restart.endswith(".toml"):
        # "--restart SCENE" means "SCENE --restart"
        options.scene, options.restart = restart, ""
    elif options.scene is None and (restart or (restart is not None and options.output)):
        folder = Path(restart).parent if restart else Path(options.output)
        options.output = options.output or str(folder)
        return folder / "scene.toml"
    return packaged_scene() if options.scene is None else options.scene


def _load(path: Path | str, options: Namespace) -> Scene:
    """Read a scene with the overrides of the command line, on one rank. Raises SceneError."""
    restart = getattr(options, "restart", None)
    if options.scene is None and restart and not Path(restart).is_file():
        raise SceneError([f"--restart {restart}: expected a checkpoint, found no such file"])
    if options.scene is None and restart is not None and not Path(path).is_file():
        raise SceneError([f"{path}: expected the scene of the run to continue, found none"])
    end_time = [] if options.end_time is None else [f"end_time={options.end_time!r}"]
    return load_scene(path, [*options.set, *end_time], options.trust_code)


def options_of(options: Namespace) -> RunOptions:
    """The options of a run from a command line."""
    return RunOptions(
        restart=options.restart,
        allow_change=tuple(options.allow_change),
        max_steps=options.max_steps,
        wall_time=options.wall_time,
        error_bars=options.error_bars,
        target=tuple(options.target),
        core_seconds=options.core_seconds,
        trust_code=options.trust_code,
        level=QUIET if options.quiet else VERBOSE if options.verbose else NORMAL,
        profile=options.profile,
        inputs=(str(options.scene),) if options.scene else (),
        silence=tuple(options.silence),
    )


def run(comm: MPI.Intracomm, options: Namespace) -> int:
    """Run a scene to its end; the exit status. Collective."""
    began = clock.perf_counter()
    _refuse_verbose_with_quiet_or_dry_run(options)
    if options.core_seconds is not None and not options.target:
        raise SceneError([f"--core-seconds: expected --target with it, found {options.core_seconds:g} alone"])
    REQUEST.install()
    try:
        LOG.open(comm, options.log)
    except OutputError as error:
        raise SolverError(str(error)) from error
    scene = load(comm, options)
    folder = Path(options.output or scene.output.directory)
    return run_scene(comm, scene, folder, options_of(options), began)


def _refuse_verbose_with_quiet_or_dry_run(options: Namespace) -> None:
    """Raises SceneError for --verbose beside --quiet or --dry-run, with which it has no effect."""
    for name in ("quiet", "dry_run"):
        if options.verbose and getattr(options, name):
            raise SceneError([f"--verbose: expected no --{name.replace('_', '-')} with it, found both"])


def check(comm: MPI.Intracomm, options: Namespace) -> int:
    """Set a scene up and print its cost, unless a dry run is quiet; exit status 0. Collective."""
    from parsolid.api.report import check_scene

    if options.command == "run":
        _refuse_verbose_with_quiet_or_dry_run(options)
    report = check_scene(comm, load(comm, options), getattr(options, "ranks", None), getattr(options, "picture", None))
    if comm.rank == 0 and not getattr(options, "quiet", False):
        print(report.lines(options.silence), flush=True)
    return 0
