"""`parsolid study`: runs of scenes over resolutions and options, and their report."""

from pathlib import Path
from typing import Any

from parsolid.commands.arguments import TRUST_CODE, refuse_files, whole_number
from parsolid.launcher import refuse_ranks


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument("study", metavar="STUDY", help="TOML file of the study")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder of the runs and reports (default: results/STUDY)")
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    only = "run only this series, or runs whose title matches (* and ? stand for anything); may be repeated"
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help=only)
    parser.add_argument("--dry-run", action="store_true", help="list the runs and their state, and stop")
    repetitions = "repeat each run until it was timed N times; the least time counts"
    parser.add_argument("--jobs", type=whole_number, default=1, metavar="N", help="so many runs at once")
    parser.add_argument("--repetitions", type=whole_number, default=1, metavar="N", help=repetitions)


def run_study(comm: Any, options: Any) -> int:
    """Make the missing runs of a study and report; exit status of `campaign.study.run_study`.

    Raises SceneError for a faulty study or scene, SolverError if started by mpirun.
    """
    refuse_ranks(comm, "study")
    from parsolid.campaign.study import run_study

    folder = Path(options.output or Path("results") / Path(options.study).stem)
    refuse_files(output=folder)
    return run_study(
        options.study,
        folder,
        options.only,
        options.repetitions,
        options.trust_code,
        dry_run=options.dry_run,
        jobs=options.jobs,
    )
