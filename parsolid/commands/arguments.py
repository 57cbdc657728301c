"""Values that arguments of the command line may take."""

import argparse
from typing import Any

TRUST_CODE = "run the Python files of laws that the scene names"


def whole_number(text: str) -> int:
    """A whole number of at least 1; raises argparse.ArgumentTypeError."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number of at least 1, found {text}")
    return value


def seconds(text: str) -> float:
    """A positive number of seconds; raises argparse.ArgumentTypeError."""
    value = float(text)
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
