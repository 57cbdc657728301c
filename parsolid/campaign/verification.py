"""Several studies as one: their runs made beside one another, and a report of what each left in summary.json."""

import csv
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import parsolid
from parsolid.campaign.comparison import INSIDE, NEAR, SHARE, UNRESOLVED, Row
from parsolid.campaign.report import comparison_table
from parsolid.campaign.study import Planned, make_runs, new_console, report
from parsolid.exit_status import DONE, WENT_WRONG
from parsolid.output.errors import OutputError
from parsolid.output.summary import read_summary, write_summary
from parsolid.scene.validation_errors import SceneError

# what is verified where nothing is named, relative to the folder that the package is in
USUAL = ("tests/verification", "runs/*/studies/stiff_and_extreme.toml")
# the folders of the studies of the last verification: others in its folder are of earlier ones
ASKED = "studies.json"


def studies_of(named: Iterable[str]) -> list[str]:
    """Files of studies: those named, all of folders, the usual ones where nothing is. Raises SceneError."""
    names = list(named)
    if not names:
        root = Path(parsolid.__file__).resolve().parent.parent
        names = [str(path) for pattern in USUAL for path in sorted(root.glob(pattern))]
    found, faults = list[str](), list[str]()
    for name in names:
        path = Path(name)
        inside = [str(one) for one in sorted(path.glob("*.toml"))] if path.is_dir() else [name] * path.is_file()
        faults += [] if inside else [f"verify: expected a study, or a folder of studies, found {name}"]
        found += inside
    if faults or not found:
        raise SceneError(faults or ["verify: expected studies, found none beside the package"])
    return list(dict.fromkeys(found))


def folders_of(studies: list[str], folder: Path) -> list[Path]:
    """The folder of each study's runs and summary below one: named after its file, with that file's folders where
    others have the name."""
    names, result = Counter(Path(one).stem for one in studies), list[Path]()
    for one in studies:
        path = Path(one)
        above = [part for part in path.resolve().parts[-3:-1] if part != "studies"]
        name = path.stem if names[path.stem] == 1 else "_".join([*above, path.stem])
        place, number = folder / name, 1
        while place in result:
            number += 1
            place = folder / f"{name}_{number}"
        result.append(place)
    return result


def run_verification(studies: list[str], folder: Path, jobs: int, page: Path, trust_code: bool = False) -> int:
    """Make the runs of studies that are lacking, so many at once, and build the report; the exit status, for one rank.

    Raises SceneError for a faulty study or scene, before anything is run.
    """
    faults, planned, places = list[Any](), list[Planned](), folders_of(studies, folder)
    for path, place in zip(studies, places):
        try:
            planned.append(Planned.read(path, place, trust_code))
        except SceneError as error:
            faults += [one if str(one).startswith(path) else f"{path}: {one}" for one in error.faults]
    if faults:
        raise SceneError(faults)
    console = new_console()
    # the largest first, so that none is left alone at the end
    runs = sorted(((one, case) for one in planned for case in one.cases), key=lambda run: -run[1].particles)
    status = make_runs(console, runs, 1, jobs)
    wrong = False
    for one in planned:
        rows = report(console, one, pictures=False)
        wrong = wrong or any(row.faulty for row in rows) or any(case.faults for case in one.cases)
    if any(case.record is not None for one in planned for case in one.cases):
        write_summary(folder / ASKED, {"studies": [place.name for place in places]})
        console.print(f"written: {build_report(folder, page)}", soft_wrap=True)
    return status or (WENT_WRONG if wrong else DONE)


@dataclass
class Summary:
    """What a study left: its entries, and its rows."""

    entries: dict[str, Any]
    rows: list[Row]

    @property
    def published(self) -> list[Row]:
        """Rows with a published number."""
        return [row for row in self.rows if row.reference is not None]


def read_summaries(folder: Path) -> list[Summary]:
    """The summaries in a folder of the studies of its last verification, of all below it where there was none.

    Raises SceneError where there is no summary, OutputError for damaged ones.
    """
    found, paths = [], sorted(folder.glob("*/summary.json"))
    if (folder / ASKED).is_file():
        asked = read_summary(folder / ASKED).get("studies", ())
        paths = [path for path in paths if path.parent.name in asked]
    for path in paths:
        entries = read_summary(path)
        if "rows" in entries and "study" in entries:
            try:
                found.append(Summary(entries, [Row.of(one) for one in entries["rows"]]))
            except (TypeError, KeyError) as error:
                raise OutputError(f"{path}: not as this version writes it: {error}") from error
    if not found:
        raise SceneError([f"verify: expected summaries of studies, STUDY/summary.json, in {folder}, found none"])
    return found


def build_report(folder: Path, page: Path) -> Path:
    """Write report.md, report.csv and pictures into a folder, from the summaries of studies below another; the page.

    Raises SceneError where there are no summaries.
    """
    summaries = read_summaries(folder)
    page.mkdir(parents=True, exist_ok=True)
    groups: dict[str, list[Summary]] = {}
    for one in summaries:
        groups.setdefault(one.entries["group"], []).append(one)
    pictures = _pictures(groups, page)
    lines = ["# Verification and validation", *_head(summaries)]
    for group, members in groups.items():
        lines += [f"## {group}", *([f"![{group}]({pictures[group]})"] if group in pictures else [])]
        rows = [row for one in members for row in one.rows]
        lines.append(comparison_table("", rows, with_case=True).markdown().rstrip())
        remarks = [f"- {one.entries['study']}: {one.entries['remark']}" for one in members if one.entries["remark"]]
        faults = [f"- not as stated: {fault}" for one in members for fault in one.entries["faults"]]
        lines += ["\n".join([*remarks, *faults])] if remarks or faults else []
    if "costs" in pictures:
        lines += ["## Error against run time", f"![Error against run time]({pictures['costs']})"]
    path = page / "report.md"
    path.write_text("\n\n".join(lines) + "\n", encoding="utf-8")
    write_rows(page / "report.csv", [row for one in summaries for row in one.rows])
    return path


def _head(summaries: list[Summary]) -> list[str]:
    """When, where and by what the runs were made, what they cost, and how many agree."""
    entries = [one.entries for one in summaries]
    published = [row for one in summaries for row in one.published]
    asked = [row for one in summaries for row in one.rows if row.reference is None and row.agrees is not None]

    def all_of(key: str) -> str:
        return ", ".join(dict.fromkeys(str(one[key]) for one in entries if one.get(key)))

    days = sorted(str(one["written_at"]) for one in entries if one.get("written_at"))
    runs, seconds, of_processor = (
        sum(one[key] for one in entries) for key in ("runs", "core_seconds", "processor_seconds")
    )
    where = [f"Commit {all_of('git_hash') or 'unknown'}", f"host {all_of('host')}", all_of("cores")]
    lines = [
        f"- {len(entries)} studies, {runs} runs, {seconds:.3g} core-seconds, {of_processor:.3g} s of the processor.",
        f"- {', '.join(filter(None, where))}; {' to '.join(dict.fromkeys(days[:1] + days[-1:]))}.",
    ]
    if published:
        verdicts = Counter(row.verdict for row in published)
        counted = ", ".join(f"{number} {verdict}" for verdict, number in verdicts.most_common())
        lines.append(
            f"- {len(published)} numbers beside published ones: {counted}. *{INSIDE}*: no farther apart than the run's "
            f"bar and the published scatter together; *{NEAR}*: within {100.0 * SHARE:g} %, or the tolerance that is "
            f"shown, where the source gives no scatter; *{UNRESOLVED}*: not farther apart, but the run's bar is wider "
            "than scatter and tolerance, and could show no disagreement of that size."
        )
    if asked:
        lines.append(f"- {len(asked)} numbers with a bound: {sum(bool(row.agrees) for row in asked)} as stated.")
    lines.append(
        "- *computed* is of the finest run, its bar that of the discretisation from all resolutions, *order* the one "
        "observed; *core-s* are seconds of the finest run's time loop times ranks."
    )
    return ["\n".join(lines)]


def _pictures(groups: dict[str, list[Summary]], page: Path) -> dict[str, str]:
    """Pictures of groups and of costs, by group: file names; none without matplotlib."""
    try:
        from parsolid.campaign.pictures import draw_comparisons, draw_costs

        made = {}
        for group, members in groups.items():
            rows = [row for one in members for row in one.published]
            if any(row.reference and row.computed is not None for row in rows):
                name = "".join(letter if letter.isalnum() else "_" for letter in group) + ".png"
                made[group] = draw_comparisons(group, rows, page / name).name
        rows = [row for members in groups.values() for one in members for row in one.rows]
        if any(len(row.errors()) > 1 for row in rows):
            made["costs"] = draw_costs(rows, page / "error_against_time.png").name
        return made
    except ModuleNotFoundError:
        return {}


def write_rows(path: Path, rows: list[Row]) -> None:
    """All rows in a CSV file, without their levels."""
    names = [name for name in Row.__dataclass_fields__ if name != "levels"]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        writer.writerows([getattr(row, name) for name in names] for row in rows)
