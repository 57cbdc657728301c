"""A study: makes the runs that are not there yet, then judges and reports all that are."""

import shlex
import signal
import time as clock
from collections.abc import Iterator
from contextlib import contextmanager
from fnmatch import fnmatchcase
from itertools import pairwise
from math import log
from pathlib import Path
from statistics import median
from typing import Any

from rich.console import Console

from parsolid.campaign.cases import Case, cases_of
from parsolid.campaign.measures import measures_of
from parsolid.campaign.report import (
    print_tables,
    shown_errors,
    spaced,
    tables_of,
    write_study_csv,
    write_study_markdown,
)
from parsolid.campaign.runner import LASTING, REFUSED, Record, read_record
from parsolid.campaign.study_file import Study, load_study
from parsolid.exit_status import DONE, TO_BE_CONTINUED, WENT_WRONG
from parsolid.machine import cores_in_words
from parsolid.scene.validation_errors import SceneError, describe, suggestion
from parsolid.simulation.job import FAILED
from parsolid.simulation.loop import FINISHED

_ENDING = {"stable": FINISHED, "failure": FAILED, "refused": REFUSED}


def run_study(
    path: str, folder: Path, only: list[str], repetitions: int = 1, trust_code: bool = False, dry_run: bool = False
) -> int:
    """Make the runs of a study that are lacking and report; the exit status, for one rank.

    0: every run there is did what the study states; 3: some did not; 75: interrupted, the same command goes on.
    Raises SceneError for a faulty study or scene.
    """
    study = load_study(path)
    cases = cases_of(study, trust_code)
    chosen = _chosen(cases, only)
    console = Console(highlight=False, width=None if Console().is_terminal else 180)
    for case in cases:
        case.record = read_record(_folder(folder, case))
    if dry_run:
        _list(console, chosen, repetitions)
        return DONE
    status = DONE
    try:
        with _interruptible():
            _make(console, study, chosen, folder, repetitions)
    except KeyboardInterrupt:
        console.print("interrupted: what is finished is kept, the same command goes on and draws the pictures")
        status = TO_BE_CONTINUED
    # who ends it waits for it
    report(console, study, cases, folder, path, pictures=status == DONE)
    return status or (WENT_WRONG if any(case.faults for case in cases) else DONE)


def report(
    console: Console, study: Study, cases: list[Case], folder: Path, study_path: str, pictures: bool = True
) -> None:
    """Judge the runs that have a record; print tables, write study.csv, study.md and pictures into the folder."""
    for case in cases:
        _measure(case)
    judge(study, cases)
    tables = tables_of(study, cases)
    if not tables:
        return
    print_tables(console, tables)
    write_study_csv(folder / "study.csv", study, cases)
    write_study_markdown(folder / "study.md", study, f"parsolid study {study_path}", _load_remark(cases), tables)
    written = [folder / "study.csv", folder / "study.md"]
    if pictures and study.report == "accuracy":
        try:
            from parsolid.campaign.pictures import draw_study

            written += draw_study(study, cases, folder)
        except ModuleNotFoundError as error:
            console.print(f"no pictures: {error.name} is not installed (parsolid[plot])")
    faulty = sum(bool(case.faults) for case in cases)
    done = sum(case.record is not None for case in cases)
    console.print(f"{done} of {len(cases)} runs made, {done - faulty} as stated, {faulty} not")
    console.print(f"written: {', '.join(map(str, written))}", soft_wrap=True)


def judge(study: Study, cases: list[Case]) -> None:
    """Fill in `orders` and `faults` of all cases that have a record."""
    for line in lines_of(cases).values():
        for coarse, fine in pairwise(line):
            fine.orders = observed_orders(coarse, fine)
    for case in cases:
        if case.record is not None:
            case.faults = [*_ending_faults(case.record, case.expect), *_number_faults(study, case)]


def lines_of(cases: list[Case]) -> dict[tuple[Any, ...], list[Case]]:
    """Cases with a spacing and errors, by the line they are on, from coarse to fine."""
    lines: dict[tuple[Any, ...], list[Case]] = {}
    for case in cases:
        if case.spacing is not None and case.measures.get("errors"):
            lines.setdefault(case.line, []).append(case)
    return {name: sorted(line, key=lambda case: -(case.spacing or 0.0)) for name, line in lines.items()}


def observed_orders(coarse: Case, fine: Case) -> dict[str, float]:
    """log(error ratio) / log(spacing ratio) of two runs, by the error's name."""
    spacings: Any = coarse.spacing, fine.spacing
    ratio = log(spacings[0] / spacings[1])
    before, after = coarse.measures["errors"], fine.measures["errors"]
    return {
        name: log(before[name] / after[name]) / ratio
        for name in after
        if ratio > 0.0 and before.get(name) and after[name]
    }


def _ending_faults(record: Record, expect: str | None) -> list[str]:
    stated, faults = _ENDING[expect or "stable"], []
    if record.status != stated:
        message = (record.message or "").split("\n")[0]
        faults.append(f"{record.status}, not {stated}" + (f": {message}" if message else ""))
    elif not record.ending["clean"]:
        faults.append("not one clean message" if record.message else "a message though it finished")
    if record.ending["not_finite"]:
        faults.append(f"not finite: {', '.join(record.ending['not_finite'])}")
    return faults


def _number_faults(study: Study, case: Case) -> list[str]:
    """Bounds, other codes and orders that a finished run misses."""
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


def _measure(case: Case) -> None:
    if case.record is not None and case.record.status in LASTING:
        case.measures = measures_of(case.record)


def _folder(folder: Path, case: Case) -> Path:
    return folder / "runs" / case.folder_name


def _chosen(cases: list[Case], only: list[str]) -> list[Case]:
    """The cases of --only: a series' name, or a pattern for a run's title."""

    def meant(case: Case, name: str) -> bool:
        return case.series.name == name or fnmatchcase(case.title, name)

    for name in only:
        if not any(meant(case, name) for case in cases):
            known = list(dict.fromkeys(case.series.name for case in cases))
            raise SceneError(
                [f"--only: expected one of {', '.join(known)}{suggestion(name, known)}, found {describe(name)}"]
            )
    return [case for case in cases if not only or any(meant(case, name) for name in only)]


def _lacking(case: Case, repetitions: int) -> bool:
    record = case.record
    if record is None or record.status not in LASTING:
        return True
    return record.status == FINISHED and len(record.loop_seconds) < repetitions


def _list(console: Console, cases: list[Case], repetitions: int) -> None:
    for case in cases:
        state = case.record.status if case.record is not None and not _lacking(case, repetitions) else "to do"
        console.print(f"{state:<10} {case.title}: {case.particles} particles, {case.ranks} ranks", markup=False)
        command = shlex.join(["parsolid", *case.arguments(Path(case.folder_name))])
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
            case.record = case.launched.run(_folder(folder, case), repetitions)
        _measure(case)
        left = seconds_left(cases, lacking[number:], repetitions)
        remains = f"about {_duration(left)} left" if number < len(lacking) else "done"
        line = f"[{number:>{width}}/{len(lacking)}] {case.title}: {_outcome(study, case, case.record)}"
        console.print(f"{line}; {clock.perf_counter() - began:.1f} s, {remains}", markup=False, soft_wrap=True)


def _outcome(study: Study, case: Case, record: Record) -> str:
    """How a run went, in a few words."""
    if record.status != FINISHED:
        return f"{record.status}: {(record.message or '').partition(chr(10))[0]}"
    errors = case.measures.get("errors") or {}
    first = [f"{spaced(name)} {errors[name]:.1e}" for name in shown_errors(study, [case])[:2]]
    return ", ".join([f"{record.status}, {record.seconds:.3g} CPU s", *first])


def seconds_left(cases: list[Case], todo: list[Case], repetitions: int) -> float:
    """Estimate [s] for runs to come, from those that were made: a start-up, and a cost that grows as
    particles x steps.
    """
    made = [(case, case.record) for case in cases if case.record is not None and case.record.ending.get("seconds")]
    if not made:
        return 0.0
    # what runs took beside their steps, of which the first waits for kernels to be compiled
    start_up = min(record.ending["seconds"] - min(record.loop_seconds, default=0.0) for _, record in made)
    rates: dict[str, list[float]] = {}
    for case, record in made:
        if case.work and any(record.loop_seconds):
            rates.setdefault(case.series.name, []).append(min(record.loop_seconds) / case.work)
    overall = median([rate for group in rates.values() for rate in group] or [0.0])
    return repetitions * sum(start_up + case.work * min(rates.get(case.series.name, [overall])) for case in todo)


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def _load_remark(cases: list[Case]) -> str:
    """In what company the times were taken."""
    loads = [min(case.record.ending["load"]) for case in cases if case.record is not None]
    span = f"{min(loads):.1f} to {max(loads):.1f}"
    return f"Load average of the machine when the runs began: {span} on {cores_in_words()}."


@contextmanager
def _interruptible() -> Iterator[None]:
    """SIGTERM, which batch systems send, ends the study as the keyboard does."""

    def interrupt(number: Any, frame: Any) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
