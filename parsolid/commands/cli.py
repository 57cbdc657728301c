"""The command line: run, check, bench, point, study, keys, schema, init, plot, view.

Exit status: 0 done, 2 bad input, 3 the run went wrong, 75 stopped with a checkpoint to continue from,
130 interrupted from the keyboard at once, 141 nobody reads what is printed any more (`| head`; a run goes on),
1 an error of the machine or of the program.
"""

import argparse
import os
import sys
from contextlib import suppress
from importlib import import_module
from typing import NoReturn

from mpi4py import MPI

from parsolid import __version__
from parsolid.collective import SolverError
from parsolid.commands.arguments import TRUST_CODE, error_arguments, seconds, whole_number
from parsolid.launcher import refuse_strangers
from parsolid.output.errors import OutputError
from parsolid.output.log import LOG
from parsolid.output.whereabouts import HERE, report
from parsolid.scene.validation_errors import SceneError, suggestion

DONE, FAILED, BAD_INPUT, WENT_WRONG, INTERRUPTED, UNREAD = 0, 1, 2, 3, 130, 141


class _BadArguments(Exception):
    """The command line itself is wrong."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise _BadArguments(f"{message}\n{self.format_usage().rstrip()}")


def _scene_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="TOML file (default: the twisting column)")
    parser.add_argument(
        "-o", "--output", metavar="DIR", help="folder of the results (default: output.directory of the scene)"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY.PATH=VALUE", help="override a key of the scene"
    )
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    parser.add_argument("--end-time", type=seconds, metavar="T", help="simulated time to stop at [s]")
    parser.add_argument("-q", "--quiet", action="store_true", help="say nothing but errors")
    parser.add_argument("-v", "--verbose", action="store_true", help="say more")


def build_parser(command: str) -> argparse.ArgumentParser:
    """The parser of all commands, with the arguments of one of them."""
    parser = _Parser(prog="parsolid", description="Solids simulated with particles on many processors.")
    parser.add_argument("--version", action="version", version=f"parsolid {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)
    run = commands.add_parser("run", help="run a scene (the default command)")
    _scene_arguments(run)
    run.add_argument(
        "--restart", nargs="?", const="", metavar="FILE", help="continue from a checkpoint (default: the newest in DIR)"
    )
    run.add_argument(
        "--allow-change",
        action="append",
        default=[],
        metavar="KEY.PATH",
        help="let this key of the scene differ from that of the checkpoint",
    )
    run.add_argument("--max-steps", type=whole_number, metavar="N", help="stop after so many steps")
    run.add_argument("--wall-time", type=seconds, metavar="S", help="write a checkpoint and stop after so many seconds")
    run.add_argument("--log", metavar="FILE", help="also append what the run says to a file, with -q too")
    run.add_argument(
        "--profile", action="store_true", help="which functions take the time, in DIR/profile-RANK.txt; slower"
    )
    run.add_argument("--dry-run", action="store_true", help="set up, report, and stop")
    error_arguments(run)
    check = commands.add_parser("check", help="set a scene up and report its cost, without running it")
    _scene_arguments(check)
    check.add_argument("--ranks", type=whole_number, metavar="N", help="also tell the cost on so many ranks")
    bench = commands.add_parser("bench", help="measure the speed of the kernels on this machine")
    bench.add_argument("--method", default=_BENCHES[0], choices=_BENCHES, help=f"the method (default {_BENCHES[0]})")
    bench.add_argument(
        "--particles", type=whole_number, default=28000, metavar="N", help="about how many particles (default 28000)"
    )
    bench.add_argument(
        "--scaling", type=whole_number, metavar="N", help="also measure whole steps on all ranks with N particles"
    )
    for name, (module, summary) in _MODULES.items():
        sub = commands.add_parser(name, help=summary)
        if name == command:
            import_module(module).add_arguments(sub)
    return parser


# modules of parsolid.commands.bench
_BENCHES = ("tlsph", "peridynamics", "mpm", "ulsph")
_PLOTTING = ("pyvista", "vtkmodules", "matplotlib")
# commands of their own modules, imported only when they are asked for
_MODULES = {
    "point": ("parsolid.commands.point", "drive a material along a path of deformation, without particles"),
    "study": ("parsolid.commands.study", "run scenes over resolutions and options; error against run time"),
    "keys": ("parsolid.commands.keys", "what a scene may say: every key with meaning, unit, default and bounds"),
    "schema": ("parsolid.commands.keys.json_schema", "JSON Schema of scenes, for editors that complete and check TOML"),
    "init": ("parsolid.commands.keys.starting", "write a commented scene of a method to start from"),
    "plot": ("parsolid.commands.plot", "pictures of a run: energies, probes, the deformed body"),
    "view": ("parsolid.commands.view", "turn a run's bodies in a window, or write a page that turns in a browser"),
}
COMMANDS = ("run", "check", "bench", *_MODULES)


def parse(arguments: list[str]) -> argparse.Namespace:
    """Parsed arguments; `run` is the command where a scene is named in its place, or nothing is."""
    if not arguments or (arguments[0] not in COMMANDS and arguments[0] not in ("-h", "--help", "--version")):
        word = arguments[0] if arguments else "-"
        if word[0:1] != "-" and not word.endswith(".toml") and not os.path.exists(word):
            known = f"expected a scene or one of {', '.join(COMMANDS)}"
            raise _BadArguments(f"{known}, found {word!r}{suggestion(word, COMMANDS)}")
        arguments = ["run", *arguments]
    return build_parser(arguments[0]).parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run a command on all ranks; the exit status. Prints one message, on rank 0, for bad input and failed runs."""
    comm = MPI.COMM_WORLD
    HERE.folder, HERE.checkpoint, HERE.job = None, None, comm.bcast(os.getpid())
    try:
        return _status(comm, sys.argv[1:] if arguments is None else arguments)
    except BrokenPipeError:
        if comm.size > 1:
            # quietly, too: the others may wait for this one
            comm.Abort(UNREAD)
        return UNREAD
    finally:
        LOG.close()
        _drop_unread()


def _drop_unread() -> None:
    """Let nothing of what nobody reads be written again, and complained of, when the program ends."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _status(comm: MPI.Intracomm, arguments: list[str]) -> int:
    try:
        return _dispatch(comm, arguments)
    except (_BadArguments, SceneError, SolverError) as error:
        _say(comm, f"parsolid: {_headline(error)}")
        return BAD_INPUT
    except OutputError as error:
        _say(comm, f"parsolid: {error}{HERE.told()}")
        return FAILED
    except KeyboardInterrupt:
        _say(comm, "parsolid: interrupted")
        if comm.size > 1:
            comm.Abort(INTERRUPTED)
        return INTERRUPTED
    except SystemExit as exit_request:
        if exit_request.code and comm.size > 1:
            # tables that nobody reads, on the one rank that prints them
            comm.Abort(UNREAD)
        return int(exit_request.code or 0)
    except BrokenPipeError:
        raise
    except Exception as error:  # a fault of the program: end all ranks rather than leave them waiting
        from parsolid.simulation.loop import RunFailed

        if isinstance(error, RunFailed):
            _say(comm, f"parsolid: {error}")
            return WENT_WRONG
        if isinstance(error, ModuleNotFoundError) and error.name in _PLOTTING:
            _say(comm, f"parsolid: {error.name} is not installed: pip install 'parsolid[plot]'")
            return FAILED
        told = report(error)
        if told is not None:
            LOG.say(f"parsolid: {told}")
            print(f"parsolid: {told}", file=sys.stderr, flush=True)
        if comm.size > 1:
            # the others may wait for this one
            comm.Abort(FAILED)
        return FAILED


def _headline(error: Exception) -> str:
    faults = getattr(error, "faults", None)
    if faults and len(faults) > 1:
        return f"the scene has {len(faults)} faults:\n  " + "\n  ".join(faults)
    return str(error)


def _say(comm: MPI.Intracomm, text: str) -> None:
    if comm.rank == 0:
        LOG.say(text)
        with suppress(BrokenPipeError):
            print(text, file=sys.stderr, flush=True)


def _dispatch(comm: MPI.Intracomm, arguments: list[str]) -> int:
    if comm.rank > 0 and any(argument in ("-h", "--help", "--version") for argument in arguments):
        return DONE
    options = parse(arguments)
    if options.command in _MODULES:
        command = getattr(import_module(_MODULES[options.command][0]), f"run_{options.command}")
        return _printed(command(comm, options))
    refuse_strangers(comm)
    if options.command == "bench":
        from parsolid.commands.bench import bench

        return _printed(bench(comm, options.method, options.particles, options.scaling))
    from parsolid.commands.run import check, run

    if options.command == "check" or options.dry_run:
        return _printed(check(comm, options))
    return run(comm, options)


def _printed(status: int) -> int:
    """The status of a command of which all has been read that it printed; raises BrokenPipeError."""
    sys.stdout.flush()
    return int(status)
