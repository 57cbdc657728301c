"""Log-log pictures of a study: error against run time and error against spacing, one panel a kind of error."""

from pathlib import Path

import numpy as np

from parsolid.study.cases import Case
from parsolid.study.judging import lines_of
from parsolid.study.schema import Study
from parsolid.study.tables import shown_errors, spaced

_MARKERS = "osD^vPX*<>hd"
_DOTS_PER_INCH = 90


def draw(study: Study, cases: list[Case], folder: Path) -> list[Path]:
    """Write error_against_time.png and error_against_spacing.png where there are runs for them; the files written."""
    lines = {name: line for name, line in _all_lines(cases).items() if line}
    written = []
    against = (
        ("time", "processor seconds of the time loop, all ranks", lambda case: case.measures["processor_seconds"]),
        ("spacing", "particle spacing [m]", lambda case: case.spacing),
    )
    for word, label, abscissa in against:
        drawn = lines if word == "time" else lines_of(cases)
        if drawn:
            written.append(_picture(study, drawn, abscissa, label, folder / f"error_against_{word}.png"))
    return written


def _all_lines(cases: list[Case]) -> dict[tuple, list[Case]]:
    """Runs with errors by line; those without a spacing in the order of the study."""
    lines = lines_of(cases)
    for case in cases:
        if case.spacing is None and case.measures.get("errors"):
            lines.setdefault((case.series.name,), []).append(case)
    return lines


def _picture(study: Study, lines: dict, abscissa, label: str, path: Path) -> Path:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    names = shown_errors(study, [case for line in lines.values() for case in line])
    panels = list(dict.fromkeys(_panel(name) for name in names))
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure, axes = pyplot.subplots(rows, columns, figsize=(5.2 * columns, 3.9 * rows), squeeze=False, layout="constrained")
    for panel, place in zip(panels, axes.flat):
        drawn = [_line(place, i, line, name, panel, abscissa) for i, line in enumerate(lines.values()) for name in names
                 if _panel(name) == panel]  # fmt: skip
        place.set(xscale="log", yscale="log", xlabel=label, title=panel)
        place.grid(True, which="both", alpha=0.25)
        points = [point for piece in drawn for point in piece]
        if points and "spacing" in label:
            _triangles(place, np.array(points))
    for place in list(axes.flat)[len(panels) :]:
        place.set_visible(False)
    handles = {text: handle for place in axes.flat for handle, text in zip(*place.get_legend_handles_labels())}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2, fontsize=8)
    figure.suptitle(study.title, fontsize=11)
    figure.savefig(path, dpi=_DOTS_PER_INCH)
    pyplot.close(figure)
    return path


def _panel(name: str) -> str:
    """The panel that an error belongs to: its name without the time, one for all probes."""
    return "probe" if "." in name.split("@")[0] else spaced(name.split("@")[0])


def _line(place, number: int, line: list[Case], name: str, panel: str, abscissa) -> list[tuple[float, float]]:
    """Draw one error of one line, and its yardstick hollow and dotted; the points drawn."""
    points = [(abscissa(case), case.measures["errors"].get(name)) for case in line]
    points = [(x, y) for x, y in points if x and y]
    if not points:
        return []
    color, marker = f"C{number % 10}", _MARKERS[number % len(_MARKERS)]
    text = ", ".join(line[0].line)
    style = "-" if "@" not in name else ("-", "--", "-.", ":")[sorted({n for n in line[0].measures["errors"] if spaced(n).startswith(panel)}).index(name) % 4]
    if "@" in name:
        text += f", t = {name.split('@')[1]} s"
    place.plot(*zip(*points), style, color=color, marker=marker, markersize=4.5, linewidth=1.3, label=text)
    yardstick = [
        (abscissa(case) if case.spacing and abscissa(case) == case.spacing else case.yardstick.get("processor_seconds"), case.yardstick.get(name))
        for case in line
    ]
    yardstick = [(x, y) for x, y in yardstick if x and y]
    if yardstick:
        place.plot(*zip(*yardstick), ":", color=color, marker=marker, markersize=6, markerfacecolor="none", linewidth=0.8, label="yardstick")
    return points


def _triangles(place, points: np.ndarray) -> None:
    """Slopes 1 and 2 below the points."""
    x1 = np.sqrt(points[:, 0].min() * points[:, 0].max())
    x0, y0 = x1 / 1.6, points[:, 1].min() * 0.6
    for slope in (1, 2):
        y1 = y0 * (x1 / x0) ** slope
        place.plot([x0, x1, x1], [y0, y0, y1], color="0.4", linewidth=0.8)
        place.plot([x0, x1], [y0, y1], color="0.4", linewidth=0.8)
        place.annotate(str(slope), (x1, y1), xytext=(3, -4), textcoords="offset points", fontsize=8, color="0.3")
