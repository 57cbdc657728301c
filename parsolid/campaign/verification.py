"""Verification: the runs of several studies made together, and one report built from their summaries."""

import csv
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import parsolid
from parsolid.campaign.comparison import INSIDE, NEAR, SHARE, UNRESOLVED, Row
from parsolid.campaign.report import comparison_table
from parsolid.campaign.study import Planned, make_runs, new_console, report
from parsolid.exit_status import DONE, WENT_WRONG
from parsolid.output.errors import OutputError
from parsolid.output.summary import read_summary, write_summary
from parsolid.scene.validation_errors import SceneError

# studies that are run if none is named, relative to the folder of the package
DEFAULT_STUDIES = ("tests/verification", "runs/*/studies/stiff_and_extreme.toml")
# file with the names of the folders of the last verification; other folders beside it are of earlier ones
ASKED = "studies.json"


def studies_of(named: Iterable[str]) -> list[str]:
    """Files of studies: the files named and all in the folders named, or the default ones. Raises SceneError."""
    names = list(named)
    if not names:
        root = Path(parsolid.__file__).resolve().parent.parent
        names = [str(path) for pattern in DEFAULT_STUDIES for path in sorted(root.glob(pattern))]
    studies, faults = list[str](), list[str]()
    for name in names:
        path = Path(name)
        in_folder = [str(file) for file in sorted(path.glob("*.toml"))]
        if path.is_file():
            studies.append(name)
        elif in_folder:
            studies += in_folder
        else:
            faults.append(f"verify: expected a study, or a folder of studies, found {name}")
    if faults or not studies:
        raise SceneError(faults or ["verify: expected studies, found none beside the package"])
    return list(dict.fromkeys(studies))


def folders_of(studies: list[str], folder: Path) -> list[Path]:
    """Folders of the studies' runs and summaries below `folder`, named after their files; studies with files of one
    name get the names of their folders in front, and a number if that is not enough."""
    count_of_name, folders = Counter(Path(study).stem for study in studies), list[Path]()
    for study in studies:
        path = Path(study)
        name = path.stem
        if count_of_name[name] > 1:
            name = "_".join([*(part for part in path.resolve().parts[-3:-1] if part != "studies"), name])
        study_folder, number = folder / name, 1
        while study_folder in folders:
            number += 1
            study_folder = folder / f"{name}_{number}"
        folders.append(study_folder)
    return folders


def run_verification(studies: list[str], folder: Path, jobs: int, page: Path, trust_code: bool = False) -> int:
    """Make the missing runs of studies, `jobs` at once, and build the report; the exit status. For one rank.

    Raises SceneError for a faulty study or scene before anything is run.
    """
    faults, all_planned, folders = list[Any](), list[Planned](), folders_of(studies, folder)
    for path, study_folder in zip(studies, folders):
        try:
            all_planned.append(Planned.read(path, study_folder, trust_code))
        except SceneError as error:
            faults += [fault if str(fault).startswith(path) else f"{path}: {fault}" for fault in error.faults]
    if faults:
        raise SceneError(faults)
    console = new_console()
    runs = [(planned, case) for planned in all_planned for case in planned.cases]
    # the largest run first, so that it does not run alone at the end
    runs.sort(key=lambda run: -run[1].particles)
    status, faulty = make_runs(console, runs, 1, jobs), False
    for planned in all_planned:
        rows = report(console, planned, pictures=False)
        faulty = faulty or any(row.faulty for row in rows) or any(case.faults for case in planned.cases)
    if any(case.record is not None for _, case in runs):
        write_summary(folder / ASKED, {"studies": [study_folder.name for study_folder in folders]})
        console.print(f"written: {build_report(folder, page)}", soft_wrap=True)
    return status or (WENT_WRONG if faulty else DONE)


class Summary(NamedTuple):
    """The summary.json of a study: its entries, and its rows."""

    entries: dict[str, Any]
    rows: list[Row]


def read_summaries(folder: Path) -> list[Summary]:
    """The summaries below a folder: of the studies in studies.json, or of all studies if there is no such file.

    Raises SceneError if there is no summary, OutputError for a damaged one.
    """
    summaries, paths = [], sorted(folder.glob("*/summary.json"))
    if (folder / ASKED).is_file():
        asked = read_summary(folder / ASKED).get("studies", ())
        paths = [path for path in paths if path.parent.name in asked]
    for path in paths:
        entries = read_summary(path)
        if "rows" in entries and "study" in entries:
            try:
                summaries.append(Summary(entries, [Row.of(row) for row in entries["rows"]]))
            except (TypeError, KeyError) as error:
                raise OutputError(f"{path}: not as this version writes it: {error}") from error
    if not summaries:
        raise SceneError([f"verify: expected summaries of studies, STUDY/summary.json, in {folder}, found none"])
    return summaries


def build_report(folder: Path, page: Path) -> Path:
    """Write report.md, report.csv and pictures into the folder `page` from the summaries below `folder`.

    Returns the path of report.md. Raises SceneError if there are no summaries.
    """
    summaries = read_summaries(folder)
    page.mkdir(parents=True, exist_ok=True)
    groups: dict[str, list[Summary]] = {}
    for summary in summaries:
        groups.setdefault(summary.entries["group"], []).append(summary)
    pictures = _pictures(groups, page)
    parts = ["# Verification and validation", _head(summaries)]
    for group, members in groups.items():
        parts.append(f"## {group}")
        if group in pictures:
            parts.append(f"![{group}]({pictures[group]})")
        rows = [row for summary in members for row in summary.rows]
        parts.append(comparison_table("", rows, with_case=True).markdown().rstrip())
        entries = [summary.entries for summary in members]
        notes = [f"- {one['study']}: {one['remark']}" for one in entries if one["remark"]]
        notes += [f"- not as stated: {fault}" for one in entries for fault in one["faults"]]
        if notes:
            parts.append("\n".join(notes))
    if "costs" in pictures:
        parts += ["## Error against run time", f"![Error against run time]({pictures['costs']})"]
    path = page / "report.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    names = [name for name in Row.__dataclass_fields__ if name != "levels"]
    with open(page / "report.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([getattr(row, name) for name in names] for summary in summaries for row in summary.rows)
    return path


def _head(summaries: list[Summary]) -> str:
    """A list of the commit, machine and dates of the runs, their costs, and the numbers of verdicts."""
    entries = [summary.entries for summary in summaries]
    published = [row for summary in summaries for row in summary.rows if row.reference is not None]
    bounded = [row for one in summaries for row in one.rows if row.reference is None and row.agrees is not None]

    def all_of(key: str) -> str:
        return ", ".join(dict.fromkeys(str(one[key]) for one in entries if one.get(key)))

    days = sorted(str(one["written_at"]) for one in entries if one.get("written_at"))
    runs, core, cpu = (sum(one[key] for one in entries) for key in ("runs", "core_seconds", "processor_seconds"))
    where = [f"Commit {all_of('git_hash') or 'unknown'}", f"host {all_of('host')}", all_of("cores")]
    lines = [
        f"- {len(entries)} studies, {runs} runs, {core:.3g} core-seconds, {cpu:.3g} processor seconds.",
        f"- {', '.join(filter(None, where))}; {' to '.join(dict.fromkeys(days[:1] + days[-1:]))}.",
    ]
    if published:
        verdicts = Counter(row.verdict for row in published)
        counted = ", ".join(f"{number} {verdict}" for verdict, number in verdicts.most_common())
        lines.append(
            f"- {len(published)} values compared with published ones: {counted}. *{INSIDE}*: the difference is within "
            f"the sum of the run's error bar and the published scatter; *{NEAR}*: within {100.0 * SHARE:g} %, or the "
            f"tolerance shown, where the source gives no scatter; *{UNRESOLVED}*: the difference is as small, but the "
            "run's error bar is wider than scatter and tolerance."
        )
    if bounded:
        lines.append(f"- {len(bounded)} values with a bound: {sum(bool(row.agrees) for row in bounded)} as stated.")
    lines.append(
        "- *computed*: value of the finest run with the discretisation error bar from all resolutions; *order*: "
        "observed order; *core-s*: wall seconds of the finest run's time loop times ranks."
    )
    return "\n".join(lines)


def _pictures(groups: dict[str, list[Summary]], page: Path) -> dict[str, str]:
    """Draw a picture for each group and one of "costs"; their file names by group, none without matplotlib."""
    try:
        from parsolid.campaign.pictures import draw_comparisons, draw_costs

        names = {}
        for group, members in groups.items():
            rows = [row for summary in members for row in summary.rows if row.reference is not None]
            if any(row.reference and row.computed is not None for row in rows):
                name = "".join(letter if letter.isalnum() else "_" for letter in group) + ".png"
                names[group] = draw_comparisons(group, rows, page / name).name
        rows = [row for members in groups.values() for summary in members for row in summary.rows]
        if any(len(row.errors()) > 1 for row in rows):
            names["costs"] = draw_costs(rows, page / "error_against_time.png").name
        return names
    except ModuleNotFoundError:
        return {}
