"""`parsolid pareto`: search for the options of a scene with the least error of a column for their run time."""

from pathlib import Path
from typing import Any

from parsolid.campaign.options import options_of
from parsolid.commands.arguments import OVERRIDE, TRUST_CODE, positive, refuse_files

# default limit of core-seconds
BUDGET = 600.0


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument("scene", metavar="SCENE", help="TOML file")
    parser.add_argument("--column", required=True, metavar="COLUMN", help="of history.csv, as kinetic or tip.twist")
    budget = f"at most so many core-seconds in all (default {BUDGET:g})"
    parser.add_argument("--core-seconds", type=positive, default=BUDGET, metavar="S", help=budget)
    axis = "vary only this, such as kernel, weights, integrator, method; may be repeated"
    parser.add_argument("--axis", action="append", default=[], metavar="NAME", help=axis)
    parser.add_argument("-o", "--output", metavar="DIR", help="folder of the runs (default: results/SCENE-pareto)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY.PATH=VALUE", help=OVERRIDE)
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    parser.add_argument("--dry-run", action="store_true", help="list the runs, and stop")


def run_pareto(comm: Any, options: Any) -> int:
    """Compare the options of a scene; the exit status, 0, or 75 after a signal. Collective.

    Raises SceneError for a faulty scene or an unknown column or axis, SolverError if no coarser scene can be made.
    """
    from parsolid.api.scenes import scene_on_all_ranks
    from parsolid.campaign.in_process import InProcess
    from parsolid.campaign.pareto import plan_of, run_pareto
    from parsolid.campaign.targets import columns_of
    from parsolid.output.log import print_line
    from parsolid.scene import SceneError, load_scene
    from parsolid.scene.validation_errors import suggestion
    from parsolid.simulation.signals import REQUEST

    REQUEST.install()
    scene = scene_on_all_ranks(comm, lambda: load_scene(options.scene, options.set, options.trust_code))
    for word, names, known in (
        ("--column", [options.column], columns_of(scene)),
        ("--axis", options.axis, sorted({axis for option in options_of(scene, []) for axis in option.axes})),
    ):
        for name in names:
            if name not in known:
                found = f"expected one of {', '.join(known)}{suggestion(name, known)}, found {name!r}"
                raise SceneError([f"{word}: {found}"])

    def say(text: str) -> None:
        if comm.rank == 0:
            print_line(text)

    plan = plan_of(scene, options.column, options.axis, options.trust_code)
    folder = Path(options.output or Path("results") / f"{Path(options.scene).stem}-pareto")
    refuse_files(output=folder)
    command = f"parsolid pareto {options.scene} --column {options.column}"
    return run_pareto(InProcess(comm, folder), plan, options.core_seconds, command, say, options.dry_run)
