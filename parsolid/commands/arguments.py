"""Arguments of commands, their types, and printed tables."""

import argparse
import os
import tempfile
from pathlib import Path
from typing import Any

from parsolid.scene.codes import CODES
from parsolid.scene.validation_errors import SceneError, suggestion


def show_table(title: str, names: list[str], rows: list[list[Any]]) -> None:
    """Print a table with right-aligned columns."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for name in names:
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(*map(str, row))
    Console(width=110).print(table)


_NO_LOGS = (".toml", ".csv", ".json", ".h5", ".hdf5", ".vtkhdf", ".sums", ".msh", ".inp", ".py", ".png")
TRUST_CODE = "run the Python files of laws that the scene names"
OVERRIDE = "override a key of the scene; KEY.PATH= takes it out; may be repeated"


def whole_number(text: str) -> int:
    """A whole number of at least 1; raises argparse.ArgumentTypeError."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, found {text}")
    return value


def positive(text: str) -> float:
    """A positive number; raises argparse.ArgumentTypeError."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a positive number, found {text!r}")
    return value


def code(text: str) -> str:
    """The code of a warning or note; raises argparse.ArgumentTypeError."""
    if text not in CODES:
        raise argparse.ArgumentTypeError(f"expected one of {', '.join(CODES)}{suggestion(text, CODES)}, found {text!r}")
    return text


def log_file(text: str) -> str:
    """A name that no input and no result has, since a log adds its lines; raises argparse.ArgumentTypeError."""
    if text.lower().endswith(_NO_LOGS):
        raise argparse.ArgumentTypeError(f"expected a file that is neither scene, data nor result, found {text!r}")
    return text


def scene_arguments(parser: Any) -> None:
    """Add the arguments that `run` and `check` share."""
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="TOML file (default: the example, a twisting column)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY.PATH=VALUE", help=OVERRIDE)
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    parser.add_argument("--end-time", type=positive, metavar="T", help="simulated time to stop at [s]")
    silence = "leave out the warning or note of this code; may be repeated"
    parser.add_argument("--silence", action="append", default=[], type=code, metavar="CODE", help=silence)


def run_arguments(parser: Any) -> None:
    """Add the arguments of `run`."""
    scene_arguments(parser)
    output = "folder of the results (default: output.directory of the scene)"
    parser.add_argument("-o", "--output", metavar="DIR", help=output)
    parser.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("-v", "--verbose", action="store_true", help="print more")
    ranks = "start so many ranks with the mpirun of this MPI (without it: those of the mpirun that started this)"
    parser.add_argument("--ranks", type=whole_number, metavar="N", help=ranks)
    restart = "continue from a checkpoint (default: the newest in DIR)"
    parser.add_argument("--restart", nargs="?", const="", metavar="FILE", help=restart)
    change = "let this key of the scene differ from that of the checkpoint; may be repeated"
    parser.add_argument("--allow-change", action="append", default=[], metavar="KEY.PATH", help=change)
    parser.add_argument(
        "--max-steps",
        type=whole_number,
        metavar="N",
        help="stop after so many steps, with --error-bars of the finest run alone",
    )
    stop = "write a checkpoint and stop after so many seconds"
    parser.add_argument("--wall-time", type=positive, metavar="S", help=stop)
    parser.add_argument("--log", type=log_file, metavar="FILE", help="also append all messages to a file, with -q too")
    profile = "write the times of functions into DIR/profile-RANK.txt; slower"
    parser.add_argument("--profile", action="store_true", help=profile)
    parser.add_argument("--dry-run", action="store_true", help="set up, report, and stop")
    bars = "run coarser scenes first and give every result its error bar"
    parser.add_argument("--error-bars", action="store_true", help=bars)
    target = "run from coarse to fine until the error bar is as small, such as tip.twist=2%%; may be repeated"
    parser.add_argument("--target", action="append", default=[], metavar="COLUMN=BAR", help=target)
    budget = "with --target: stop at so many core-seconds in all"
    parser.add_argument("--core-seconds", type=positive, metavar="S", help=budget)


def check_arguments(parser: Any) -> None:
    """Add the arguments of `check`."""
    scene_arguments(parser)
    parser.add_argument("--ranks", type=whole_number, metavar="N", help="also predict the cost on so many ranks")
    picture = "draw bodies, regions, supports, loads and interfaces into FILE (png, pdf, svg)"
    parser.add_argument("--picture", metavar="FILE", help=picture)


def refuse_files(**folders: Path) -> None:
    """Raise SceneError if an output folder is a file or in one, or cannot be written; folders: by their arguments."""
    for name, path in folders.items():
        nearest = next(one for one in (path, *path.absolute().parents) if one.exists())
        if not nearest.is_dir():
            raise SceneError([f"--{name}: expected a folder, found the file {nearest}"])
        try:
            # permissions do not tell: a file system may refuse its owner
            os.rmdir(tempfile.mkdtemp(prefix=".parsolid-", dir=nearest))
        except OSError as error:
            raise SceneError(
                [f"--{name}: expected a folder that can be written, found {path} ({error.strerror})"]
            ) from None
