"""`parsolid verify`: several studies and one report of verification and validation."""

from pathlib import Path
from typing import Any

from parsolid.commands.arguments import TRUST_CODE, refuse_files, whole_number
from parsolid.exit_status import DONE
from parsolid.launcher import refuse_ranks
from parsolid.scene.validation_errors import SceneError


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    studies = "files of studies, or folders of them (default: the verification of a checkout)"
    parser.add_argument("studies", metavar="STUDY", nargs="*", help=studies)
    where = "folder of the runs and summaries (default: results/verification)"
    parser.add_argument("-o", "--output", metavar="DIR", default="results/verification", help=where)
    parser.add_argument("--jobs", type=whole_number, default=1, metavar="N", help="so many runs at once")
    parser.add_argument("--report", action="store_true", help="run nothing, only report on the summaries in the folder")
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    page = "folder of report.md, report.csv and pictures (default: that of the runs)"
    parser.add_argument("--page", metavar="DIR", help=page)


def run_verify(comm: Any, options: Any) -> int:
    """Make the missing runs of studies and build the report; the exit status.

    0: all as stated; 3: something is not; 75: interrupted. Raises SceneError for faulty studies, SolverError if started
    by mpirun.
    """
    refuse_ranks(comm, "verify")
    from parsolid.campaign.verification import build_report, run_verification, studies_of

    folder = Path(options.output)
    page = Path(options.page or folder)
    refuse_files(output=folder, page=page)
    if options.report and options.studies:
        raise SceneError([f"--report: expected no studies, because nothing is run, found {' '.join(options.studies)}"])
    if options.report:
        print(f"written: {build_report(folder, page)}")
        return DONE
    return run_verification(studies_of(options.studies), folder, options.jobs, page, options.trust_code)
