"""The command `point`: a material point driven along a prescribed deformation; no particles, one rank does it all."""

from typing import Any

from parsolid.commands.arguments import TRUST_CODE


def add_arguments(parser: Any) -> None:
    """Give the arguments of `point` to an argparse parser."""
    parser.add_argument(
        "path", metavar="PATH", help="TOML file with a material and the path of its deformation gradient"
    )
    parser.add_argument(
        "-o", "--output", metavar="DIR", help="folder of the results (default: output.directory of the file)"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY.PATH=VALUE", help="override a key of the file"
    )
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    parser.add_argument("-q", "--quiet", action="store_true", help="say nothing but errors")


def run_point(comm: Any, options: Any) -> int:
    """Drive a material point; the exit status 0. Collective: rank 0 works, the others wait for its outcome.

    Raises SceneError (bad input), OutputError or RunFailed (the path cannot be followed) on all ranks.
    """
    from parsolid.output.errors import OutputError
    from parsolid.scene.validation_errors import SceneError
    from parsolid.simulation.loop import RunFailed

    error = None
    if comm.rank == 0:
        from parsolid.commands.point.report import drive_and_report

        try:
            drive_and_report(options)
        except (SceneError, OutputError, RunFailed) as found:
            error = (type(found), *found.args)
    error = comm.bcast(error)
    if error is not None:
        raise error[0](*error[1:])
    return 0
