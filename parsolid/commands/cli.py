"""The command line.

Exit status: 0 done, 2 bad input, 3 the run went wrong, 4 a target was not reached, 75 stopped with a checkpoint, 130
interrupted from the keyboard, 141 the output pipe is closed (`| head`; a run continues), 1 an error of the machine or
the program.
"""

import argparse
import errno
import gc
import os
import sys
from contextlib import suppress
from importlib import import_module
from typing import Any, NoReturn

from mpi4py import MPI

from parsolid import __version__
from parsolid.collective import SolverError
from parsolid.commands.arguments import check_arguments, run_arguments
from parsolid.exit_status import BAD_INPUT, DONE, FAILED, INTERRUPTED, UNREAD, WENT_WRONG
from parsolid.launcher import refuse_strangers, run_on_ranks
from parsolid.output.crash_report import CONTEXT, report
from parsolid.output.errors import OutputError
from parsolid.output.log import LOG
from parsolid.scene.validation_errors import SceneError, suggestion
from parsolid.simulation.signals import REQUEST

_PLOTTING = ("pyvista", "vtkmodules", "matplotlib")
# command -> summary; the module of a command is imported only if it is given
COMMANDS = {
    "run": "run a scene (the default command)",
    "check": "set a scene up and report its cost, without running it",
    "modes": "eigenfrequencies and shapes of vibrations of a scene's bodies",
    "study": "run scenes over resolutions and options; error against run time",
    "verify": "run several studies and report computed, exact and published values",
    "pareto": "which options of a scene have the least error for their time",
    "import": "turn a mesh file into one that all ranks of a run read in parallel",
    "point": "drive a material along a path of deformation, without particles",
    "fit": "parameters of a hyperelastic law from measured stretches and stresses",
    "plot": "pictures of a run: energies, probes, the deformed body",
    "view": "turn a run's bodies in a window, or write a page that turns in a browser",
    "keys": "all keys of a scene with meaning, unit, default and bounds; a scene to start from",
    "bench": "measure the speed of the kernels on this machine",
}
# modules with names other than their commands
_MODULES = {"import": "import_mesh"}
# commands and options of earlier versions -> their replacements
_OLD_COMMANDS = {"schema": "keys --json", "init": "keys --new METHOD"}
_OLD_OPTIONS = {
    ("run", "--cost"): "--core-seconds",
    ("study", "--pareto"): "parsolid pareto SCENE --column COLUMN",
    ("study", "--budget"): "parsolid pareto SCENE --column COLUMN --core-seconds S",
    ("study", "--axis"): "parsolid pareto SCENE --column COLUMN --axis NAME",
    ("pareto", "--budget"): "--core-seconds",
}
_EXAMPLE = """\
parsolid SCENE is parsolid run SCENE; parsolid COMMAND --help lists the options of a command.
The example, a twisting column, needs no file: parsolid run, or on 4 ranks parsolid run --ranks 4"""


class _BadArguments(Exception):
    """The command line is faulty."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise _BadArguments(f"{message}\n{self.format_usage().rstrip()}")


def _module_of(command: str) -> Any:
    return import_module(f"parsolid.commands.{_MODULES.get(command, command)}")


def build_parser(command: str = "") -> argparse.ArgumentParser:
    """The parser of all commands, with the arguments of one of them."""
    about = "Solids simulated with particles on many processors."
    layout = argparse.RawDescriptionHelpFormatter
    parser = _Parser(prog="parsolid", description=about, epilog=_EXAMPLE, formatter_class=layout)
    parser.add_argument("--version", action="version", version=f"parsolid {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)
    for name, summary in COMMANDS.items():
        sub = commands.add_parser(name, help=summary)
        if name == "run":
            run_arguments(sub)
        elif name == "check":
            check_arguments(sub)
        elif name == command:
            _module_of(name).add_arguments(sub)
    return parser


def parse(arguments: list[str]) -> argparse.Namespace:
    """Parsed arguments; without a command it is `run`."""
    word = arguments[0] if arguments else ""
    if word not in COMMANDS and word not in ("-h", "--help", "--version"):
        if word in _OLD_COMMANDS:
            raise _BadArguments(f"expected {_OLD_COMMANDS[word]}, found {word!r}, its name in earlier versions")
        if word[0:1] != "-" and not word.endswith(".toml") and not os.path.exists(word):
            known = f"expected a scene or one of {', '.join(COMMANDS)}"
            raise _BadArguments(f"{known}, found {word!r}{suggestion(word, COMMANDS)}")
        arguments = ["run", *arguments]
    for option, value in zip(arguments[1:], [*arguments[2:], "-"]):
        name, equals, stated = option.partition("=")
        if option[:1] == "-" and (stated if equals else value) == "":
            raise _BadArguments(f"expected a value after {name}, found '', as of a variable that is not set")
    for option in (argument.partition("=")[0] for argument in arguments[1:]):
        if (arguments[0], option) in _OLD_OPTIONS:
            new = _OLD_OPTIONS[arguments[0], option]
            raise _BadArguments(f"expected {new}, found {option}, its name in earlier versions")
    return build_parser(arguments[0]).parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run a command on all ranks; the exit status. Prints one message, on rank 0, for bad input and failed runs."""
    comm = MPI.COMM_WORLD
    # garbage collection at the default threshold takes a fifth of the start-up time, and steps leave no cycles
    gc.set_threshold(50_000, *gc.get_threshold()[1:])
    CONTEXT.folder, CONTEXT.checkpoint, CONTEXT.job = None, None, comm.bcast(os.getpid())
    try:
        return _status(comm, sys.argv[1:] if arguments is None else arguments)
    except BrokenPipeError:
        if comm.size > 1:
            # the other ranks may wait for this one
            comm.Abort(UNREAD)
        return UNREAD
    finally:
        LOG.close()
        # a request to stop does not hold for the next command in this process
        REQUEST.received = None
        # prevents a second BrokenPipeError when the program ends
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except BrokenPipeError:
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _status(comm: MPI.Intracomm, arguments: list[str]) -> int:
    try:
        return _dispatch(comm, arguments)
    except (_BadArguments, SceneError, SolverError) as error:
        faults = getattr(error, "faults", ())
        text = str(error)
        if len(faults) > 1:
            text = f"the scene has {len(faults)} faults:\n  " + "\n  ".join(faults)
        _say(comm, f"parsolid: {text}")
        return BAD_INPUT
    except OutputError as error:
        _say(comm, f"parsolid: {error}{CONTEXT.describe()}")
        return FAILED
    except KeyboardInterrupt:
        _say(comm, "parsolid: interrupted")
        if comm.size > 1:
            comm.Abort(INTERRUPTED)
        return INTERRUPTED
    except SystemExit as exit_request:
        if exit_request.code and comm.size > 1:
            # the rank that prints a table has found the pipe closed
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
        if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG and comm.size == 1:
            _say(comm, f"parsolid: expected a shorter name, found {error.filename}")
            return BAD_INPUT
        message = report(error)
        if message is not None:
            LOG.say(f"parsolid: {message}")
            print(f"parsolid: {message}", file=sys.stderr, flush=True)
        if comm.size > 1:
            # the other ranks may wait for this one
            comm.Abort(FAILED)
        return FAILED


def _say(comm: MPI.Intracomm, text: str) -> None:
    if comm.rank == 0:
        LOG.say(text)
        with suppress(BrokenPipeError):
            print(text, file=sys.stderr, flush=True)


def _dispatch(comm: MPI.Intracomm, arguments: list[str]) -> int:
    """Run the command of a command line; without arguments print the help."""
    if comm.rank > 0 and any(argument in ("-h", "--help", "--version") for argument in arguments):
        return DONE
    if not arguments:
        if comm.rank == 0:
            build_parser().print_help()
        return _printed(DONE)
    options = parse(arguments)
    if options.command == "run" and options.ranks is not None:
        return run_on_ranks(comm, arguments, options.ranks)
    if options.command in ("run", "check"):
        refuse_strangers(comm)
        from parsolid.commands.run import check, run

        if options.command == "run" and not options.dry_run:
            return run(comm, options)
        return _printed(check(comm, options))
    if options.command == "bench":
        refuse_strangers(comm)
    command = getattr(_module_of(options.command), f"run_{options.command}")
    return _printed(command(comm, options))


def _printed(status: int) -> int:
    """The status, after flushing stdout; raises BrokenPipeError if the pipe is closed."""
    sys.stdout.flush()
    return int(status)
