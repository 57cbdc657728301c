"""Log-log pictures of a study: error against run time and error against spacing, one panel a kind of error."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.commands.study.cases import Case
from parsolid.commands.study.judging import lines_of
from parsolid.commands.study.schema import Study
from parsolid.commands.study.tables import shown_errors, spaced

_MARKERS = "osD^vPX*<>hd"
# of a panel
MOST_CURVES = 8
_STYLES = ("-", "--", "-.", ":")
_DOTS_PER_INCH = 90


@dataclass
class Abscissa:
    """What errors are drawn against: a value of a run, and the same of another code; slopes to be shown with it."""

    name: str
    label: str
    value: Callable[[Case], float | None]
    other_code: Callable[[Case], float | None]
    slopes: tuple[int, ...] = ()


TIME = Abscissa(
    "time",
    "processor seconds of the time loop, all ranks",
    lambda case: case.measures["processor_seconds"],
    lambda case: case.other_code.get("processor_seconds"),
)
SPACING = Abscissa("spacing", "particle spacing [m]", lambda case: case.spacing, lambda case: case.spacing, (1, 2))


def draw(study: Study, cases: list[Case], folder: Path) -> list[Path]:
    """Write error_against_time.png and error_against_spacing.png where there are runs for them; the files written.

    Raises ModuleNotFoundError without matplotlib.
    """
    spaced_lines = lines_of(cases)
    every_line = dict(spaced_lines)
    for case in cases:
        if case.spacing is None and case.measures.get("errors"):
            every_line.setdefault((case.series.name,), []).append(case)
    wanted = ((TIME, every_line), (SPACING, spaced_lines))
    return [_picture(study, lines, abscissa, folder) for abscissa, lines in wanted if lines]


def _picture(study: Study, lines: dict[tuple[Any, ...], list[Case]], abscissa: Abscissa, folder: Path) -> Path:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    names = shown_errors(study, [case for line in lines.values() for case in line])
    panels = _panels(lines, names)
    columns = min(2, max(1, len(panels)))
    rows = max(1, -(-len(panels) // columns))
    figure, axes = pyplot.subplots(
        rows, columns, figsize=(5.2 * columns, 3.9 * rows), squeeze=False, layout="constrained"
    )
    for place in axes.flat[len(panels) :]:
        place.set_visible(False)
    for (title, errors, numbers), place in zip(panels, axes.flat):
        place.set(xscale="log", yscale="log", xlabel=abscissa.label, ylabel="error", title=title)
        place.grid(True, which="both", alpha=0.25)
        place.tick_params(axis="x", which="minor", labelsize=6)
        points = []
        for number in numbers:
            line = list(lines.values())[number]
            for style, error in zip(_STYLES * len(errors), errors):
                points += _line(place, number, line, error, style, abscissa)
        if points and abscissa.slopes:
            _triangles(place, np.array(points), abscissa.slopes)
    handles = {text: handle for place in axes.flat for handle, text in zip(*place.get_legend_handles_labels())}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2, fontsize=8)
    figure.suptitle(study.title, fontsize=11)
    path = folder / f"error_against_{abscissa.name}.png"
    figure.savefig(path, dpi=_DOTS_PER_INCH)
    pyplot.close(figure)
    return path


def _panels(lines: dict[tuple[Any, ...], list[Case]], names: list[str]) -> list[tuple[str, list[str], list[int]]]:
    """Title, errors and numbers of the lines of each panel, none with more curves than can be told apart."""
    result = []
    for panel in dict.fromkeys(map(_panel, names)):
        errors = [name for name in names if _panel(name) == panel]
        drawn = [
            i
            for i, line in enumerate(lines.values())
            if any(case.measures["errors"].get(e) for case in line for e in errors)
        ]
        most = max(1, MOST_CURVES // len(errors))
        pieces = [drawn[first : first + most] for first in range(0, len(drawn), most)] or [[]]
        titles = [panel if len(pieces) == 1 else f"{panel} ({i} of {len(pieces)})" for i in range(1, len(pieces) + 1)]
        result += [(title, errors, piece) for title, piece in zip(titles, pieces)]
    return result


def _panel(name: str) -> str:
    """The panel that an error belongs to: its name without the time, one for all probes."""
    field = name.split("@", maxsplit=1)[0]
    return "probe" if "." in field else spaced(field)


def _line(
    place: Any, number: int, line: list[Case], error: str, style: str, abscissa: Abscissa
) -> list[tuple[float, float]]:
    """Draw one error of one line, and what another code reached hollow and dotted; the points of the line."""
    points = _positive((abscissa.value(case), case.measures["errors"].get(error)) for case in line)
    if not points:
        return []
    color, marker, text = f"C{number % 10}", _MARKERS[number % len(_MARKERS)], ", ".join(line[0].line)
    if "@" in error:
        text += f", t = {error.split('@')[1]} s"
    elif "." in error:
        style = "-"
    place.plot(*zip(*points), style, color=color, marker=marker, markersize=4.5, linewidth=1.3, label=text)
    other_code = _positive((abscissa.other_code(case), case.other_code.get(error)) for case in line)
    if other_code:
        hollow = {"marker": marker, "markersize": 7, "markerfacecolor": "none", "linewidth": 0.8}
        place.plot(*zip(*other_code), ":", color=color, label="another code", **hollow)
    return points


def _positive(points: Any) -> list[tuple[float, float]]:
    return [(x, y) for x, y in points if x and y]


def _triangles(place: Any, points: Any, slopes: tuple[int, ...]) -> None:
    """Triangles of the slopes below the points (n, 2)."""
    x1 = np.sqrt(points[:, 0].min() * points[:, 0].max())
    x0, y0 = x1 / 1.6, points[:, 1].min() * 0.6
    for slope in slopes:
        y1 = y0 * (x1 / x0) ** slope
        place.plot([x0, x1, x1, x0], [y0, y0, y1, y0], color="0.4", linewidth=0.8)
        place.annotate(str(slope), (x1, y1), xytext=(3, -4), textcoords="offset points", fontsize=8, color="0.3")
