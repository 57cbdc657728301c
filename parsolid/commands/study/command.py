"""The command `study`: makes the runs that are not there yet, then reports on all that are."""

import shlex
import signal
import time as clock
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console

from parsolid.commands.arguments import TRUST_CODE, pareto_arguments, refuse_together
from parsolid.commands.study.cases import Case, cases_of
from parsolid.commands.study.judging import judge
from parsolid.commands.study.launching import LASTING, arguments_of, read_record, run_case
from parsolid.commands.study.measures import measures_of
from parsolid.commands.study.schema import Study, load_study
from parsolid.commands.study.tables import print_sheets, sheets_of, shown_errors, spaced, write_csv, write_markdown
from parsolid.launcher import refuse_ranks
from parsolid.machine import cores_in_words
from parsolid.scene.validation_errors import SceneError, suggestion, told

DONE, NOT_AS_STATED, TO_BE_CONTINUED = 0, 3, 75


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument("study", metavar="STUDY", help="TOML file of the study; with --pareto of a scene")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder of the runs and reports (default: results/STUDY)")
    parser.add_argument("--trust-code", action="store_true", help=TRUST_CODE)
    only = "run only this series, or runs whose title matches (* and ? stand for anything); may be repeated"
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help=only)
    parser.add_argument("--dry-run", action="store_true", help="list the runs and what is done of them, and stop")
    repetitions = "make each run until it was timed N times; the least time counts"
    parser.add_argument("--repetitions", type=int, default=1, metavar="N", help=repetitions)
    pareto_arguments(parser)


def run_study(comm: Any, options: Any) -> int:
    """Make the runs of a study that are lacking and report; the exit status.

    0: every run there is did what the study states; 3: some did not; 75: interrupted, the same command goes on.
    Raises SceneError for a faulty study or scene, or when started by mpirun.
    """
    if options.pareto is not None:
        refuse_together(options, "pareto")
        from parsolid.commands.pareto import run_pareto

        return run_pareto(comm, options)
    refuse_together(options, "study")
    refuse_ranks(comm, "study")
    study = load_study(options.study)
    cases = cases_of(study, options.trust_code)
    folder = Path(options.output or Path("results") / Path(options.study).stem)
    chosen = _chosen(cases, options.only)
    console = Console(highlight=False, width=None if Console().is_terminal else 180)
    for case in cases:
        case.record = read_record(_folder(folder, case))
    if options.dry_run:
        _list(console, chosen, options.repetitions)
        return DONE
    status = DONE
    try:
        with _interruptible():
            _make(console, study, chosen, folder, options.repetitions)
    except KeyboardInterrupt:
        console.print("interrupted: what is finished is kept, the same command goes on and draws the pictures")
        status = TO_BE_CONTINUED
    # who ends it waits for it
    report(console, study, cases, folder, options.study, pictures=status == DONE)
    return status or (NOT_AS_STATED if any(case.faults for case in cases) else DONE)


def report(
    console: Console, study: Study, cases: list[Case], folder: Path, study_path: str, pictures: bool = True
) -> None:
    """Judge the runs that have a record; print tables, write study.csv, study.md and pictures into the folder."""
    for case in cases:
        _measure(folder, case)
    judge(study, cases)
    sheets = sheets_of(study, cases)
    if not sheets:
        return
    print_sheets(console, sheets)
    write_csv(folder / "study.csv", study, cases)
    write_markdown(folder / "study.md", study, f"parsolid study {study_path}", _load_remark(cases), sheets)
    written = [folder / "study.csv", folder / "study.md"]
    if pictures and study.report == "accuracy":
        written += _pictures(console, study, cases, folder)
    faulty = sum(bool(case.faults) for case in cases)
    done = sum(bool(case.record) for case in cases)
    console.print(f"{done} of {len(cases)} runs made, {done - faulty} as stated, {faulty} not")
    console.print(f"written: {', '.join(map(str, written))}", soft_wrap=True)


def _pictures(console: Console, study: Study, cases: list[Case], folder: Path) -> list[Path]:
    try:
        from parsolid.commands.study.pictures import draw

        return draw(study, cases, folder)
    except ModuleNotFoundError as error:
        console.print(f"no pictures: {error.name} is not installed (parsolid[plot])")
        return []


def _measure(folder: Path, case: Case) -> None:
    record = case.record
    if record.get("status") in LASTING:
        case.measures = measures_of(_folder(folder, case), record["loop_seconds"], record["processor_seconds"])


def _folder(folder: Path, case: Case) -> Path:
    return folder / "runs" / case.folder_name


def _chosen(cases: list[Case], only: list[str]) -> list[Case]:
    """The cases of --only: a series' name, or a pattern for a run's title."""
    for name in only:
        if not any(_meant(case, name) for case in cases):
            known = list(dict.fromkeys(case.series.name for case in cases))
            raise SceneError(
                [f"--only: expected one of {', '.join(known)}{suggestion(name, known)}, found {told(name)}"]
            )
    return [case for case in cases if not only or any(_meant(case, name) for name in only)]


def _meant(case: Case, name: str) -> bool:
    return case.series.name == name or fnmatchcase(case.title, name)


def _lacking(case: Case, repetitions: int) -> bool:
    status = case.record.get("status")
    return status not in LASTING or (status == "finished" and len(case.record["loop_seconds"]) < repetitions)


def _list(console: Console, cases: list[Case], repetitions: int) -> None:
    for case in cases:
        state = "to do" if _lacking(case, repetitions) else case.record["status"]
        console.print(f"{state:<10} {case.title}: {case.particles} particles, {case.ranks} ranks", markup=False)
        command = shlex.join(["parsolid", *arguments_of(case, Path(case.folder_name))])
        console.print(f"           {command}", markup=False, style="dim", soft_wrap=True)
    console.print(f"{len(cases)} runs, {sum(_lacking(case, repetitions) for case in cases)} to do")


def _make(console: Console, study: Study, cases: list[Case], folder: Path, repetitions: int) -> None:
    """Make the runs that are lacking, with a line for each."""
    lacking = [case for case in cases if _lacking(case, repetitions)]
    if len(cases) > len(lacking):
        console.print(f"{study.title}: {len(cases) - len(lacking)} of {len(cases)} runs are there already")
    width = len(str(len(lacking)))
    for number, case in enumerate(lacking, 1):
        began = clock.perf_counter()
        with console.status(f"{case.title}: {case.particles} particles, {case.ranks} ranks"):
            case.record = run_case(case, _folder(folder, case), repetitions)
        _measure(folder, case)
        left = seconds_left(cases, lacking[number:], repetitions)
        told = f"about {_duration(left)} left" if number < len(lacking) else "done"
        line = f"[{number:>{width}}/{len(lacking)}] {case.title}: {_outcome(study, case)}"
        console.print(f"{line}; {clock.perf_counter() - began:.1f} s, {told}", markup=False, soft_wrap=True)


def _outcome(study: Study, case: Case) -> str:
    """How a run went, in a few words."""
    status = case.record["status"]
    if status != "finished":
        return f"{status}: {(case.record['message'] or '').splitlines()[0] if case.record['message'] else ''}"
    errors = case.measures.get("errors") or {}
    worst = [f"{spaced(name)} {errors[name]:.1e}" for name in shown_errors(study, [case])[:2]]
    return ", ".join([f"{status}, {case.measures['processor_seconds']:.3g} CPU s", *worst])


def seconds_left(cases: list[Case], todo: list[Case], repetitions: int) -> float:
    """Estimate [s] for runs to come, from those that were made: a start-up, and a cost that grows as
    particles x steps.
    """
    made = [case for case in cases if case.record.get("seconds")]
    if not made:
        return 0.0
    # what runs took beside their steps, of which the first waits for kernels to be compiled
    start_up = min(case.record["seconds"] - _in_steps(case) for case in made)
    rates: dict[str, list[float]] = {}
    for case in made:
        if case.work and _in_steps(case):
            rates.setdefault(case.series.name, []).append(_in_steps(case) / case.work)
    overall = median([rate for group in rates.values() for rate in group] or [0.0])
    return repetitions * sum(start_up + case.work * min(rates.get(case.series.name, [overall])) for case in todo)


def _in_steps(case: Case) -> float:
    """What a run's steps took [s]; 0 where it has none."""
    return min([seconds for seconds in case.record.get("loop_seconds", []) if seconds is not None], default=0.0)


def _duration(seconds: float) -> str:
    return (
        f"{seconds:.0f} s"
        if seconds < 90
        else f"{seconds / 60:.0f} min"
        if seconds < 5400
        else f"{seconds / 3600:.1f} h"
    )


def _load_remark(cases: list[Case]) -> str:
    """In what company the times were taken."""
    loads = [min(case.record["load"]) for case in cases if case.record.get("load")]
    span = f"{min(loads):.1f} to {max(loads):.1f}"
    return f"Load average of the machine when the runs began: {span} on {cores_in_words()}."


@contextmanager
def _interruptible() -> Any:
    """SIGTERM, which batch systems send, ends the study as the keyboard does."""

    def interrupt(number: Any, frame: Any) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
