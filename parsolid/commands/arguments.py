"""Values that arguments of the command line may take."""

import argparse
from typing import Any

from parsolid.scene.validation_errors import SceneError

TRUST_CODE = "run the Python files of laws that the scene names"


def whole_number(text: str) -> int:
    """A whole number of at least 1; raises argparse.ArgumentTypeError."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, found {text}")
    return value


def seconds(text: str) -> float:
    """A positive number of seconds; raises argparse.ArgumentTypeError."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a positive number of seconds, found {text}")
    return value


def error_arguments(parser: Any) -> None:
    """The options of `run` that ask for errors."""
    parser.add_argument(
        "--error-bars", action="store_true", help="run coarser companions first and give every result its error bar"
    )
    parser.add_argument(
        "--target",
        action="append",
        default=[],
        metavar="'COLUMN BAR'",
        help='run from coarse to fine until the bar is as small, "tip.twist 2 %%"; may be repeated',
    )
    parser.add_argument("--cost", type=seconds, metavar="CORE_S", help="with --target: stop at so many core-seconds")


def pareto_arguments(parser: Any) -> None:
    """The options of `study` that compare the choices of a scene."""
    parser.add_argument(
        "--pareto", metavar="COLUMN", help="which choices of a scene have the least error of a column for their time"
    )
    parser.add_argument("--budget", type=seconds, metavar="S", help="with --pareto: at most so many processor seconds")
    parser.add_argument(
        "--axis", action="append", default=[], metavar="NAME", help="with --pareto: vary this alone; may be repeated"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY.PATH=VALUE",
        help="with --pareto: override a key of the scene",
    )


def refuse_together(options: Any, kind: str) -> None:
    """Raise SceneError for options that a study, or a comparison of choices ("pareto"), does not take."""
    pareto = {"--budget": options.budget is not None, "--axis": options.axis, "--set": options.set}
    study = {"--only": options.only, "--repetitions": options.repetitions != 1}
    for word, given in (study if kind == "pareto" else pareto).items():
        if given:
            where = "without --pareto" if kind == "pareto" else "with --pareto"
            raise SceneError([f"{word}: expected {where}, found it {'with' if kind == 'pareto' else 'without'} it"])
