"""Tables of a study: on the terminal, as Markdown, as CSV."""

import csv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from parsolid.campaign.cases import Case, Study
from parsolid.campaign.comparison import Row
from parsolid.campaign.error_bars import in_digits_of
from parsolid.campaign.runner import MEASURES
from parsolid.simulation.job import FAILED
from parsolid.simulation.loop import FINISHED


@dataclass
class ResultTable:
    """A table of texts; `left` is the number of its first columns that are words; notes stand below it."""

    title: str
    headings: list[str]
    left: int
    rows: list[list[str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def rich(self) -> Table:
        """The table for a terminal."""
        table = Table(title=self.title, title_justify="left", title_style="bold", box=SIMPLE_HEAD)
        for i, heading in enumerate(self.headings):
            table.add_column(heading, justify="left" if i < self.left else "right", overflow="fold")
        for row in self.rows:
            table.add_row(*row, style="red" if row[-1].startswith("no") else None)
        return table

    def markdown(self) -> str:
        """The table in Markdown, with its title, if it has one, and notes."""
        rule = ["---" if i < self.left else "---:" for i in range(len(self.headings))]
        lines = [" | ".join(cells).replace("\n", " ") for cells in (self.headings, rule, *self.rows)]
        title = f"### {self.title}\n\n" if self.title else ""
        notes = "".join(f"\n- {note}" for note in self.notes)
        return title + "\n".join(f"| {line} |" for line in lines) + "\n" + (notes + "\n" if notes else "")


def tables_of(study: Study, cases: list[Case]) -> list[ResultTable]:
    """The tables of a study: one a series for errors, one of all runs for stability; runs without a record are left
    out.
    """
    done = [case for case in cases if case.record is not None]
    groups = {case.series.name: [other for other in done if other.series is case.series] for case in done}
    if study.report == "stability":
        groups = {study.title: done} if done else {}
    result = []
    for name, group in groups.items():
        result.append((_stability_table if study.report == "stability" else _accuracy_table)(study, name, group))
        result[-1].notes = [f"{case.title}: {fault}" for case in group for fault in case.faults]
    return result


def comparison_table(title: str, rows: list[Row], with_case: bool = False) -> ResultTable:
    """The rows of comparisons, of one study or, with their cases, of several."""
    headings = ["method", "quantity", "reference", "computed", "error", "tolerance", "order", "core-s", "verdict"]
    table = ResultTable(title, (["case"] if with_case else []) + headings, 2 + with_case)
    for row in rows:
        reference = row.source if row.reference is None else _with_bar(row.reference, row.scatter, row.unit)
        cells = [row.method, row.quantity, reference, _with_bar(row.computed, row.bar, row.unit), _error(row)]
        tolerance = "" if row.tolerance is None else f"{row.tolerance / (abs(row.reference or 0.0) or 1.0):.2g}"
        cells += [tolerance, "" if row.order is None else f"{row.order:.1f}"]
        cells += ["" if row.core_seconds is None else f"{row.core_seconds:.3g}", row.verdict]
        table.rows.append(([row.case] if with_case else []) + cells)
    names = [(f"{row.case}, " if with_case else "", row) for row in rows]
    notes = [f"{case}{row.quantity}: {row.source}" for case, row in names if row.reference is not None]
    told = [(case, row, row.reason) for case, row in names if row.reason]
    told += [(case, row, row.remark) for case, row in names if row.remark and row.agrees is False]
    notes += [f"{case}{row.method}, {row.quantity}: {text}" for case, row, text in told]
    table.notes = list(dict.fromkeys(notes))
    return table


def _with_bar(value: float | None, bar: float | None, unit: str) -> str:
    """A number to the second digit of its bar, with its unit."""
    if value is None:
        return ""
    text = in_digits_of(value, bar) if bar else f"{value:.4g}"
    return f"{text}{'' if bar is None else f' +- {bar:.2g}'}{' ' if unit else ''}{unit}"


def _error(row: Row) -> str:
    if row.error is None:
        return ""
    return f"{100.0 * row.error:+.2g} %" if row.reference is not None else f"{row.error:.2e}"


def shown_errors(study: Study, cases: list[Case]) -> list[str]:
    """Names of the errors of some runs, in the study's order."""
    present = dict.fromkeys(name for case in cases for name in case.measures.get("errors") or {})
    return [name for name in (present if study.errors is None else study.errors) if name in present]


def _accuracy_table(study: Study, name: str, cases: list[Case]) -> ResultTable:
    errors, axes = shown_errors(study, cases), [axis.title for axis in cases[0].series.axes]
    compared = any(case.other_code for case in cases)
    probed = any("momentum_drift" in case.measures for case in cases)
    iterated = any(case.measures.get("iterations_per_step") for case in cases)
    measured = ["particles", "steps", *(["iterations_per_step"] if iterated else []), "core_seconds"]
    measured += ["processor_seconds", "numerical_dissipation", "energy_drift"]
    measured += ["momentum_drift"] if probed else []
    headings = [*axes, "ranks", *(MEASURES[key][0] for key in measured), *map(spaced, errors)]
    table = ResultTable(
        name, headings + (["errors / other code", "CPU s / other code"] if compared else []) + ["as stated"], len(axes)
    )
    for case in cases:
        row = [*case.labels.values(), str(case.ranks), *(describe(case, key) for key in measured)]
        for error in errors:
            value = (case.measures.get("errors") or {}).get(error)
            order = f" ({case.orders[error]:.1f})" if error in case.orders else ""
            row.append("" if value is None else f"{value:.2e}{order}")
        if compared:
            ratios = case.other_code_ratios
            time = ratios.pop("processor_seconds", None)
            row += [f"{ratio:.2f}" if ratio is not None else "" for ratio in (max(ratios.values(), default=None), time)]
        table.rows.append([*row, "no" if case.faults else "yes"])
    return table


def _stability_table(study: Study, name: str, cases: list[Case]) -> ResultTable:
    measured = ["particles", "steps", "mean_step", "smallest_step", "energy_drift", "numerical_dissipation"]
    measured.append("largest_fall")
    headings = ["run", "must show", "ended", *(MEASURES[key][0] for key in measured), "ranks", "as stated"]
    table = ResultTable(name, headings, 3)
    for case in cases:
        shows = case.shows or {"failure": "a clean failure", "refused": "refused"}.get(case.expect or "", "stable")
        # of a run that is to finish
        asked = case.bounds if case.expect in (None, "stable") else {}
        bounds = [f"{MEASURES.get(name, (name,))[0]} <= {bound:g}" for name, bound in asked.items()]
        record: Any = case.record
        ended, ending = "finished", record.ending
        if record.status != FINISHED:
            clean = "cleanly, " if record.status == FAILED and ending["clean"] and not ending["not_finite"] else ""
            text = (record.message or "").split("\n")[0].removeprefix("the run failed: ")
            ended = f"{record.status} {clean}exit {ending['exit_status']}: {text}"
        row = [case.title, ", ".join([shows, *bounds]), ended, *(describe(case, key) for key in measured)]
        table.rows.append([*row, str(case.ranks), "no" if case.faults else "yes"])
    return table


def describe(case: Case, name: str) -> str:
    """A measure as a table tells it."""
    value = case.measures.get(name)
    if value is None:
        return ""
    if name == "peak_memory_bytes_per_rank":
        value /= 2**20
    return format(value, MEASURES[name][1])


def spaced(name: str) -> str:
    """An error's name with spaces where a heading may break."""
    return name.replace("_", " ").replace("@", " at t = ")


def write_study_csv(path: Path, cases: list[Case]) -> None:
    """One row a run: labels, how it ended, measures, errors, observed orders."""
    done = [case for case in cases if case.record is not None]
    axes = list(dict.fromkeys(axis for case in done for axis in case.labels))
    errors = list(dict.fromkeys(name for case in done for name in case.measures.get("errors") or {}))
    headings = ["series", *axes, "spacing", "ranks", "status", "exit_status", "as_stated", *MEASURES]
    headings += [*(f"error {name}" for name in errors), *(f"order {name}" for name in errors)]
    headings += ["load_average", "folder", "faults"]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(headings)
        for case in done:
            record: Any = case.record
            found = case.measures.get("errors") or {}
            row = [case.series.name, *(case.labels.get(axis) for axis in axes), case.spacing, case.ranks]
            row += [record.status, record.ending["exit_status"], "no" if case.faults else "yes"]
            row += [case.measures.get(name) for name in MEASURES]
            row += [found.get(name) for name in errors] + [case.orders.get(name) for name in errors]
            writer.writerow([*row, min(record.ending["load"], default=None), case.folder_name, "; ".join(case.faults)])


def print_tables(console: Console, tables: list[ResultTable]) -> None:
    """Print tables with their notes."""
    for table in tables:
        console.print(table.rich())
        for note in table.notes:
            console.print(f"  {note}", markup=False, highlight=False, style="red")


def write_study_markdown(path: Path, study: Study, command: str, remark: str, tables: list[ResultTable]) -> None:
    """The tables in Markdown under the command that makes them."""
    head = f"## {study.title}\n\nMade by `{command}`. {remark}\n\n"
    path.write_text(head + "\n".join(table.markdown() for table in tables), encoding="utf-8")
