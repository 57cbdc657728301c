"""The command `keys`: what a scene may say. Beside it `schema`, the same for editors, and `init`, to start from."""

from typing import Any


def add_arguments(parser: Any) -> None:
    """Give the arguments of `keys` to an argparse parser."""
    parser.add_argument(
        "path",
        nargs="?",
        default="",
        metavar="PATH",
        help="only this key or table, such as bodies.material or method.tlsph.smoothing",
    )


def run_keys(comm: Any, options: Any) -> int:
    """Print keys with meaning, unit, default and bounds; exit status 0. Raises SolverError for a path of no key."""
    from parsolid.commands.keys.listing import listing

    text = listing(options.path)
    if comm.rank == 0:
        print(text, flush=True)
    return 0
