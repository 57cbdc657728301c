"""Tables of a study on the terminal, in Markdown and in CSV."""

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
from parsolid.campaign.measures import MEASURES
from parsolid.simulation.job import FAILED
from parsolid.simulation.loop import FINISHED


@dataclass
class ResultTable:
    """A table of texts; the first `left` columns are left-aligned; notes are printed below it."""

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
        """The table in Markdown with title and notes."""
        rule = ["---" if i < self.left else "---:" for i in range(len(self.headings))]
        lines = [" | ".join(cells).replace("\n", " ") for cells in (self.headings, rule, *self.rows)]
        title = f"### {self.title}\n\n" if self.title else ""
        notes = "".join(f"\n- {note}" for note in self.notes)
        return title + "\n".join(f"| {line} |" for line in lines) + "\n" + (notes + "\n" if notes else "")


def tables_of(study: Study, cases: list[Case]) -> list[ResultTable]:
    """The tables of a study's finished cases: for accuracy one per series, for stability one of all runs."""
    done = [case for case in cases if case.record is not None]
    tables = []
    if study.report == "stability":
        if done:
            tables = [_stability_table(study.title, done)]
    else:
        for name in dict.fromkeys(case.series.name for case in done):
            tables.append(_accuracy_table(study, name, [case for case in done if case.series.name == name]))
    return tables


def comparison_table(title: str, rows: list[Row], with_case: bool = False) -> ResultTable:
    """The rows of comparisons; with_case: with a column of the case, for rows of several studies."""
    headings = ["method", "quantity", "reference", "computed", "error", "tolerance", "order", "core-s", "verdict"]
    table = ResultTable(title, ["case", *headings] if with_case else headings, 3 if with_case else 2)
    sources, reasons, causes = [], [], []
    for row in rows:
        reference, error = row.source, _text(row.error, ".2e")
        if row.reference is not None:
            reference, error = _with_bar(row.reference, row.scatter, row.unit), ""
            if row.error is not None:
                error = f"{100.0 * row.error:+.2g} %"
        tolerance = None if row.tolerance is None else row.tolerance / (abs(row.reference or 0.0) or 1.0)
        cells = [row.method, row.quantity, reference, _with_bar(row.computed, row.bar, row.unit), error]
        cells += [_text(tolerance, ".2g"), _text(row.order, ".1f"), _text(row.core_seconds, ".3g"), row.verdict]
        table.rows.append([row.case, *cells] if with_case else cells)
        case = f"{row.case}, " if with_case else ""
        if row.reference is not None:
            sources.append(f"{case}{row.quantity}: {row.source}")
        if row.reason:
            reasons.append(f"{case}{row.method}, {row.quantity}: {row.reason}")
        if row.remark and row.agrees is False:
            causes.append(f"{case}{row.method}, {row.quantity}: {row.remark}")
    table.notes = list(dict.fromkeys(sources + reasons + causes))
    return table


def _with_bar(value: float | None, bar: float | None, unit: str) -> str:
    """A value with its error bar and unit; the digits of the value end at the second digit of the bar."""
    if value is None:
        return ""
    text = in_digits_of(value, bar) if bar else f"{value:.4g}"
    if bar is not None:
        text += f" +- {bar:.2g}"
    return f"{text} {unit}" if unit else text


def _text(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def shown_errors(study: Study, cases: list[Case]) -> list[str]:
    """Names of the errors that cases have, of those that the study shows and in its order."""
    present = dict.fromkeys(name for case in cases for name in case.measures.get("errors") or {})
    return [name for name in (present if study.errors is None else study.errors) if name in present]


def _accuracy_table(study: Study, name: str, cases: list[Case]) -> ResultTable:
    errors, axes = shown_errors(study, cases), [axis.title for axis in cases[0].series.axes]
    has_other_code = any(case.other_code for case in cases)
    measured = ["particles", "steps"]
    if any(case.measures.get("iterations_per_step") for case in cases):
        measured.append("iterations_per_step")
    measured += ["core_seconds", "processor_seconds", "numerical_dissipation", "energy_drift"]
    if any("momentum_drift" in case.measures for case in cases):
        measured.append("momentum_drift")
    headings = [*axes, "ranks", *(MEASURES[key][0] for key in measured), *map(spaced, errors)]
    if has_other_code:
        headings += ["errors / other code", "CPU s / other code"]
    table = ResultTable(name, [*headings, "as stated"], len(axes), notes=_faults(cases))
    for case in cases:
        row = [*case.labels.values(), str(case.ranks), *(describe(case, key) for key in measured)]
        for error in errors:
            value = (case.measures.get("errors") or {}).get(error)
            order = f" ({case.orders[error]:.1f})" if error in case.orders else ""
            row.append("" if value is None else f"{value:.2e}{order}")
        if has_other_code:
            ratios = case.other_code_ratios
            time = ratios.pop("processor_seconds", None)
            row += [_text(max(ratios.values(), default=None), ".2f"), _text(time, ".2f")]
        table.rows.append([*row, "no" if case.faults else "yes"])
    return table


def _stability_table(title: str, cases: list[Case]) -> ResultTable:
    measured = ["particles", "steps", "mean_step", "smallest_step", "energy_drift", "numerical_dissipation"]
    measured.append("largest_fall")
    headings = ["run", "must show", "ended", *(MEASURES[key][0] for key in measured), "ranks", "as stated"]
    table = ResultTable(title, headings, 3, notes=_faults(cases))
    for case in cases:
        shows = case.shows or {"failure": "a clean failure", "refused": "refused"}.get(case.expect or "", "stable")
        bounds = []
        if case.expect in (None, "stable"):
            bounds = [f"{MEASURES.get(name, (name,))[0]} <= {bound:g}" for name, bound in case.bounds.items()]
        record: Any = case.record
        ended, ending = "finished", record.ending
        if record.status != FINISHED:
            clean = "cleanly, " if record.status == FAILED and ending["clean"] and not ending["not_finite"] else ""
            text = (record.message or "").split("\n")[0].removeprefix("the run failed: ")
            ended = f"{record.status} {clean}exit {ending['exit_status']}: {text}"
        row = [case.title, ", ".join([shows, *bounds]), ended, *(describe(case, key) for key in measured)]
        table.rows.append([*row, str(case.ranks), "no" if case.faults else "yes"])
    return table


def _faults(cases: list[Case]) -> list[str]:
    return [f"{case.title}: {fault}" for case in cases for fault in case.faults]


def describe(case: Case, name: str) -> str:
    """A measure in the format of the tables."""
    value = case.measures.get(name)
    if value is None:
        return ""
    if name == "peak_memory_bytes_per_rank":
        value /= 2**20
    return format(value, MEASURES[name][1])


def spaced(name: str) -> str:
    """An error's name with spaces, at which a heading may break."""
    return name.replace("_", " ").replace("@", " at t = ")


def write_study_csv(path: Path, cases: list[Case]) -> None:
    """Write one row per run: labels, status, measures, errors, observed orders."""
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
            own_errors = case.measures.get("errors") or {}
            row = [case.series.name, *(case.labels.get(axis) for axis in axes), case.spacing, case.ranks]
            row += [record.status, record.ending["exit_status"], "no" if case.faults else "yes"]
            row += [case.measures.get(name) for name in MEASURES]
            row += [own_errors.get(name) for name in errors] + [case.orders.get(name) for name in errors]
            writer.writerow([*row, min(record.ending["load"], default=None), case.folder_name, "; ".join(case.faults)])


def print_tables(console: Console, tables: list[ResultTable]) -> None:
    """Print tables with their notes."""
    for table in tables:
        console.print(table.rich())
        for note in table.notes:
            console.print(f"  {note}", markup=False, highlight=False, style="red")


def write_study_markdown(path: Path, study: Study, command: str, remark: str, tables: list[ResultTable]) -> None:
    """Write the tables in Markdown below the command that makes them."""
    head = f"## {study.title}\n\nMade by `{command}`. {remark}\n\n"
    path.write_text(head + "\n".join(table.markdown() for table in tables), encoding="utf-8")
