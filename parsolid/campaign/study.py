"""Studies: make the missing runs, compare all runs with what the study states, and report."""

import math
import shlex
import signal
from contextlib import closing
from dataclasses import asdict
from fnmatch import fnmatchcase
from itertools import pairwise
from pathlib import Path
from statistics import mean
from typing import Any, NamedTuple

from rich.console import Console

from parsolid.campaign.cases import Case, Study, cases_of, load_study
from parsolid.campaign.comparison import AS_STATED, NOT_AS_STATED, Resolution, Row, rows_of_comparison
from parsolid.campaign.measures import MEASURES
from parsolid.campaign.records import FINAL_STATUSES, REFUSED, read_record
from parsolid.campaign.report import (
    comparison_table,
    print_tables,
    shown_errors,
    spaced,
    tables_of,
    write_study_csv,
    write_study_markdown,
)
from parsolid.campaign.subprocess_runs import run_concurrently
from parsolid.exit_status import DONE, TO_BE_CONTINUED, WENT_WRONG
from parsolid.machine import cores_in_words
from parsolid.output.summary import provenance, write_summary
from parsolid.scene.validation_errors import SceneError, describe, suggestion
from parsolid.simulation.job import FAILED
from parsolid.simulation.loop import FINISHED

_ENDING = {"stable": FINISHED, "failure": FAILED, "refused": REFUSED}


class Planned(NamedTuple):
    """A study as read from its file, the folder of its results, and its cases."""

    path: str
    folder: Path
    study: Study
    cases: list[Case]

    @classmethod
    def read(cls, path: str, folder: Path, trust_code: bool = False) -> "Planned":
        """Read a study and the records of its runs. Raises SceneError for a faulty study or scene."""
        study = load_study(path)
        planned = cls(path, folder, study, cases_of(study, trust_code))
        for case in planned.cases:
            case.set_record(read_record(planned.folder_of(case)))
        return planned

    def folder_of(self, case: Case) -> Path:
        """The folder of a run."""
        return self.folder / "runs" / case.folder_name


def new_console() -> Console:
    """A console with the width of the terminal, or 180 columns for a file."""
    return Console(highlight=False, width=None if Console().is_terminal else 180)


def run_study(
    path: str,
    folder: Path,
    only: list[str],
    repetitions: int = 1,
    trust_code: bool = False,
    dry_run: bool = False,
    jobs: int = 1,
) -> int:
    """Make the missing runs of a study, `jobs` at once, and report; the exit status. For one rank.

    0: all runs are as the study states; 3: some are not; 75: interrupted, the same command continues.
    Raises SceneError for a faulty study or scene.
    """
    planned = Planned.read(path, folder, trust_code)
    chosen = _chosen(planned.cases, only)
    console = new_console()
    if dry_run:
        for case in chosen:
            state = case.record.status if case.record is not None and not _needs_run(case, repetitions) else "to do"
            console.print(f"{state:<10} {case.title}: {case.particles} particles, {case.ranks} ranks", markup=False)
            command = shlex.join(["parsolid", *case.arguments(Path(case.folder_name))])
            console.print(f"           {command}", markup=False, style="dim", soft_wrap=True)
        console.print(f"{len(chosen)} runs, {sum(_needs_run(case, repetitions) for case in chosen)} to do")
        return DONE
    status = make_runs(console, [(planned, case) for case in chosen], repetitions, jobs)
    # no pictures after an interruption: they take long
    rows = report(console, planned, pictures=status == DONE)
    if status != DONE:
        return status
    faulty = any(case.faults for case in planned.cases) or any(row.faulty for row in rows)
    return WENT_WRONG if faulty else DONE


def report(console: Console, planned: Planned, pictures: bool = True) -> list[Row]:
    """Judge the runs that have a record; print tables, write study.csv, study.md, summary.json and pictures into the
    folder. Returns the rows of the comparisons with published values.
    """
    path, folder, study, cases = planned
    judge(study, cases)
    tables = tables_of(study, cases)
    if not tables:
        return []
    # a line is compared once its finest case has been run
    lines = _by_line(cases).values()
    made = [[case for case in line if case.record is not None] for line in lines if line[-1].record is not None]
    rows = [row for comparison in study.compared for row in rows_of_comparison(study.title, comparison, made)]
    if rows:
        tables.append(comparison_table("comparison with published values", rows))
    print_tables(console, tables)
    write_study_csv(folder / "study.csv", cases)
    loads = [min(case.record.ending["load"]) for case in cases if case.record is not None]
    span = f"{min(loads):.1f} to {max(loads):.1f}"
    remark = f"Load average of the machine when the runs began: {span} on {cores_in_words()}."
    write_study_markdown(folder / "study.md", study, f"parsolid study {path}", remark, tables)
    write_summary(folder / "summary.json", summary_of_study(planned, rows + error_rows(study, cases)))
    written = [folder / "study.csv", folder / "study.md", folder / "summary.json"]
    if pictures and study.report == "accuracy":
        try:
            from parsolid.campaign.pictures import draw_study

            written += draw_study(study, cases, folder)
        except ModuleNotFoundError as error:
            console.print(f"no pictures: {error.name} is not installed (parsolid[plot])")
    wrong = sum(bool(case.faults) for case in cases)
    done = sum(case.record is not None for case in cases)
    console.print(f"{done} of {len(cases)} runs made, {done - wrong} as stated, {wrong} not")
    console.print(f"written: {', '.join(map(str, written))}", soft_wrap=True)
    return rows


def error_rows(study: Study, cases: list[Case]) -> list[Row]:
    """Rows of errors, bounds and exits of the cases that have been run; the finest case of a line has all its levels.

    In a study with comparisons, only rows that have a verdict.
    """
    rows, line_of_finest = [], {id(line[-1]): line for line in lines_of(cases).values()}
    for case in cases:
        if case.record is None:
            continue
        if case.expect in ("failure", "refused") or case.record.status != FINISHED:
            source = {"failure": "a clean failure", "refused": "refused"}.get(case.expect or "", "stable")
            rows.append(Row(study.title, case.title, "how it ends", source=source))
            rows[-1].verdict = NOT_AS_STATED if case.faults else AS_STATED
            rows[-1].reason = "; ".join(case.faults)
            continue
        for name in dict.fromkeys((*(case.measures.get("errors") or ()), *case.bounds)):
            rows.append(_error_row(study, case, name))
            line = line_of_finest.get(id(case), ())
            rows[-1].levels = [Resolution.of(level, level.value(name)) for level in line]
    return [row for row in rows if row.agrees is not None] if study.compared else rows


def _error_row(study: Study, case: Case, name: str) -> Row:
    record: Any = case.record
    row = Row(study.title, case.title, MEASURES[name][2] if name in MEASURES else spaced(name))
    reference = case.scene.reference if case.scene is not None else None
    if name not in MEASURES and reference is not None:
        if reference.exact:
            row.source = f"exact {reference.exact}"
        else:
            row.source = f"series {Path(reference.series).name}" if reference.series else "values at the end"
    row.error, row.tolerance, row.order = case.value(name), case.bounds.get(name), case.orders.get(name)
    row.core_seconds, row.line = record.core_seconds, ", ".join(case.line)
    least = case.series.orders.get(name) if name in case.orders else None
    if name in case.bounds or least is not None:
        passes = row.error is not None and row.error <= case.bounds.get(name, math.inf)
        if least is not None and case.orders[name] < least:
            passes, row.reason = False, f"the order is to be at least {least:g}"
        row.verdict = AS_STATED if passes else NOT_AS_STATED
    return row


def summary_of_study(planned: Planned, rows: list[Row]) -> dict[str, Any]:
    """Contents of summary.json: rows, costs, and the machine, version and time of the newest run."""
    _, _, study, cases = planned
    records = [case.record for case in cases if case.record is not None]
    newest = max((record.summary for record in records), key=lambda summary: str(summary.get("written_at", "")))
    return {
        "study": study.title,
        "group": study.group,
        "remark": study.remark,
        "rows": [asdict(row) for row in rows],
        "runs": len(records),
        "runs_stated": len(cases),
        "runs_faulty": sum(bool(case.faults) for case in cases),
        "faults": [f"{case.title}: {fault}" for case in cases for fault in case.faults],
        "core_seconds": sum(record.core_seconds for record in records),
        "processor_seconds": sum(record.seconds for record in records),
        "cores": cores_in_words(),
        **{key: newest.get(key, value) for key, value in provenance().items()},
    }


def judge(study: Study, cases: list[Case]) -> None:
    """Fill in `orders` and `faults` of all cases that have a record."""
    for line in lines_of(cases).values():
        for coarse, fine in pairwise(line):
            # log(error ratio) / log(spacing ratio) of two runs, by the error's name
            spacings: Any = coarse.spacing, fine.spacing
            ratio = math.log(spacings[0] / spacings[1])
            before, after = coarse.measures["errors"], fine.measures["errors"]
            fine.orders = {
                name: math.log(before[name] / after[name]) / ratio
                for name in after
                if ratio > 0.0 and before.get(name) and after[name]
            }
    for case in cases:
        if case.record is not None:
            expected, faults = _ENDING[case.expect or "stable"], []
            if case.record.status != expected:
                message = (case.record.message or "").split("\n")[0]
                faults.append(f"{case.record.status}, not {expected}" + (f": {message}" if message else ""))
            elif not case.record.ending["clean"]:
                faults.append("not one clean message" if case.record.message else "a message though it finished")
            if case.record.ending["not_finite"]:
                faults.append(f"not finite: {', '.join(case.record.ending['not_finite'])}")
            case.faults = faults + _number_faults(study, case)


def lines_of(cases: list[Case]) -> dict[tuple[Any, ...], list[Case]]:
    """Cases with a spacing and errors, grouped by `Case.line` and sorted from coarse to fine."""
    return _by_line([case for case in cases if case.spacing is not None and case.measures.get("errors")])


def _by_line(cases: list[Case]) -> dict[tuple[Any, ...], list[Case]]:
    lines: dict[tuple[Any, ...], list[Case]] = {}
    for case in cases:
        lines.setdefault(case.line, []).append(case)
    return {name: sorted(line, key=lambda case: -(case.spacing or 0.0)) for name, line in lines.items()}


def _number_faults(study: Study, case: Case) -> list[str]:
    """Bounds, errors of other codes and orders that a finished run does not reach."""
    if case.record is None or case.record.status != FINISHED:
        return []
    faults = []
    for name, bound in case.bounds.items():
        value = case.value(name)
        if value is None or not value <= bound:
            faults.append(f"{name} {'not known' if value is None else f'{value:.3g}'}, at most {bound:g}")
    for name, ratio in case.other_code_ratios.items():
        allowed = 1.0 if name == "processor_seconds" else study.allowed
        if not ratio <= allowed:
            faults.append(f"{name} {ratio:.2f} of the other code, at most {allowed:g}")
    for name, least in case.series.orders.items():
        if name in case.orders and not case.orders[name] >= least:
            faults.append(f"order of {name} {case.orders[name]:.2f}, at least {least:g}")
    return faults


def _chosen(cases: list[Case], only: list[str]) -> list[Case]:
    """The cases that --only selects by the name of a series or a pattern for the title of a run."""
    if not only:
        return cases
    chosen: dict[int, Case] = {}
    for name in only:
        matches = {
            index: case for index, case in enumerate(cases) if case.series.name == name or fnmatchcase(case.title, name)
        }
        if not matches:
            known = list(dict.fromkeys(case.series.name for case in cases))
            expected = f"one of {', '.join(known)}{suggestion(name, known)}"
            raise SceneError([f"--only: expected {expected}, found {describe(name)}"])
        chosen |= matches
    return [chosen[index] for index in sorted(chosen)]


def _needs_run(case: Case, repetitions: int) -> bool:
    record = case.record
    if record is None or record.status not in FINAL_STATUSES:
        return True
    return record.status == FINISHED and len(record.loop_seconds) < repetitions


def make_runs(console: Console, runs: list[tuple[Planned, Case]], repetitions: int, jobs: int) -> int:
    """Make the missing runs, `jobs` at once, and print a line for each; 0, or 75 if interrupted."""

    def interrupt(number: Any, frame: Any) -> None:
        raise KeyboardInterrupt

    # batch systems send SIGTERM
    previous_handler = signal.signal(signal.SIGTERM, interrupt)
    try:
        _make_missing(console, runs, repetitions, jobs)
    except KeyboardInterrupt:
        console.print("interrupted: finished runs are kept, the same command continues and draws the pictures")
        return TO_BE_CONTINUED
    finally:
        signal.signal(signal.SIGTERM, previous_handler)
    return DONE


def _make_missing(console: Console, runs: list[tuple[Planned, Case]], repetitions: int, jobs: int) -> None:
    missing = [(planned, case) for planned, case in runs if _needs_run(case, repetitions)]
    if len(runs) > len(missing):
        title = runs[0][0].study.title if len({planned.path for planned, _ in runs}) == 1 else "studies"
        console.print(f"{title}: {len(runs) - len(missing)} of {len(runs)} runs are there already")
    width, waiting, cases = len(str(len(missing))), dict(enumerate(missing)), [case for _, case in runs]
    subprocess_runs = [(case.subprocess_run, planned.folder_of(case)) for planned, case in missing]
    progress = f"{len(missing)} runs"
    if len(missing) == 1:
        progress = f"{missing[0][1].title}: {missing[0][1].particles} particles"
    if jobs > 1:
        progress += f", {jobs} at once"
    with console.status(progress), closing(run_concurrently(subprocess_runs, jobs, repetitions)) as results:
        for count, (index, record, seconds) in enumerate(results, 1):
            planned, case = waiting.pop(index)
            case.set_record(record)
            left = seconds_left(cases, [case for _, case in waiting.values()], repetitions) / jobs
            remains = f"about {_duration(left)} left" if waiting else "done"
            outcome = f"{record.status}: {(record.message or '').partition(chr(10))[0]}"
            if record.status == FINISHED:
                errors, names = case.measures.get("errors") or {}, shown_errors(planned.study, [case])[:2]
                first = [f"{spaced(name)} {errors[name]:.1e}" for name in names]
                outcome = ", ".join([f"{record.status}, {record.seconds:.3g} CPU s", *first])
            line = f"[{count:>{width}}/{len(missing)}] {case.title}: {outcome}"
            console.print(f"{line}; {seconds:.1f} s, {remains}", markup=False, soft_wrap=True)


def seconds_left(cases: list[Case], todo: list[Case], repetitions: int) -> float:
    """Estimated wall time [s] of the runs `todo`: a start-up each, and a time loop that grows as particles times steps
    within a series. A run of a series without a finished run is taken to cost the mean of all runs, since the costs of
    a particle-step differ between methods by up to a thousand.
    """
    made = [(case, case.record) for case in cases if case.record is not None and case.record.ending.get("seconds")]
    if not made:
        return 0.0
    # the least, because the first runs compile kernels
    start_up = min(record.ending["seconds"] - min(record.loop_seconds, default=0.0) for _, record in made)
    mean_loop = mean(min(record.loop_seconds, default=0.0) for _, record in made)
    rates: dict[int, float] = {}
    for case, record in made:
        if case.work and any(record.loop_seconds):
            rate = min(record.loop_seconds) / case.work
            rates[id(case.series)] = min(rate, rates.get(id(case.series), rate))
    loops = [case.work * rates[id(case.series)] if id(case.series) in rates else mean_loop for case in todo]
    return repetitions * (start_up * len(todo) + sum(loops))


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
