"""Pictures of campaigns: errors against run time and spacing, and computed over published values."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import ticker
from matplotlib.figure import Figure

from parsolid.campaign.cases import Case, Study
from parsolid.campaign.comparison import SHARE, Row
from parsolid.campaign.pareto import Configuration, Plan
from parsolid.campaign.reference import Reference
from parsolid.campaign.report import shown_errors
from parsolid.campaign.study import lines_of
from parsolid.output.words import words_of

MARKERS = "osD^vPX*<>hd"
# largest number of curves in a panel
MOST_CURVES = 8
_DOTS_PER_INCH = 90
# ratio of the ends of an axis below which 2 and 5 of each decade have labels
_DECADES = 300.0
# curves with relative differences below this look equal
_ALIKE = 0.02
_OTHER_CODE = "another code, hollow"
_ENVELOPE: dict[str, Any] = {"color": "0.8", "linewidth": 7.0, "solid_joinstyle": "round", "zorder": 0}


@dataclass
class Abscissa:
    """The abscissa of a picture of errors: its value for a run and for another code, and slopes to draw."""

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


def draw_study(study: Study, cases: list[Case], folder: Path) -> list[Path]:
    """Write error_against_time.png and error_against_spacing.png if there are runs for them; returns the files."""
    spaced_lines = lines_of(cases)
    every_line = dict(spaced_lines)
    for case in cases:
        if case.spacing is None and case.measures.get("errors"):
            every_line.setdefault((case.series.name,), []).append(case)
    requested = ((TIME, every_line), (SPACING, spaced_lines))
    return [_picture(study, lines, abscissa, folder) for abscissa, lines in requested if lines]


def _picture(study: Study, lines: dict[tuple[Any, ...], list[Case]], abscissa: Abscissa, folder: Path) -> Path:
    names = shown_errors(study, [case for line in lines.values() for case in line])
    panels = _panels(list(lines.values()), names)
    looks = _looks([curve for _, curves in panels for curve in curves])
    figure, places = _log_panels(len(panels), min(2, max(1, len(panels))), (5.2, 3.9), abscissa.label)
    for (title, curves), place in zip(panels, places):
        place.set_title(title)
        points = [point for curve in curves for point in _draw(place, curve, looks[curve.text], abscissa)]
        if points and abscissa.slopes:
            _triangles(place, np.array(points), abscissa.slopes)
        label_decades(place.xaxis)
    handles = {text: handle for place in places for handle, text in zip(*place.get_legend_handles_labels())}
    handles |= {_OTHER_CODE: handles.pop(_OTHER_CODE)} if _OTHER_CODE in handles else {}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2, fontsize=8, frameon=False)
    figure.suptitle(study.title, fontsize=11)
    path = folder / f"error_against_{abscissa.name}.png"
    figure.savefig(path, dpi=_DOTS_PER_INCH)
    return path


def _log_panels(count: int, columns: int, size: tuple[float, float], label: str) -> tuple[Figure, list[Any]]:
    """A figure of logarithmic panels of errors, each of a size [inches], and its first `count` panels; label: of the
    abscissae."""
    rows = max(1, -(-count // columns))
    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    places = list(figure.subplots(rows, columns, squeeze=False).flat)
    for number, place in enumerate(places):
        place.set(xscale="log", yscale="log", xlabel=label, ylabel="error", visible=number < count)
        place.grid(True, which="both", alpha=0.25)
    return figure, places[:count]


@dataclass
class Curve:
    """One error of one line of runs, and its text in the legend."""

    line: list[Case]
    error: str
    text: str


def _panels(lines: list[list[Case]], names: list[str]) -> list[tuple[str, list[Curve]]]:
    """Title and curves of each panel; a panel with more than MOST_CURVES curves is split."""
    result = []
    for panel in dict.fromkeys(map(_panel, names)):
        errors = [name for name in names if _panel(name) == panel]
        curves = [curve for line in lines for curve in _curves(line, errors)]
        parts = max(1, -(-len(curves) // MOST_CURVES))
        ends = [len(curves) * part // parts for part in range(parts + 1)]
        pieces = [curves[first:last] for first, last in pairwise(ends)]
        titles = [panel if len(pieces) == 1 else f"{panel} ({i} of {len(pieces)})" for i in range(1, len(pieces) + 1)]
        result += list(zip(titles, pieces))
    return result


def _curves(line: list[Case], errors: list[str]) -> list[Curve]:
    """A curve for each error of a line of runs, but for errors that look like an earlier one."""
    drawn: dict[str, list[float]] = {}
    for error in errors:
        values = [case.measures["errors"].get(error) or 0.0 for case in line]
        alike = [all(abs(a - b) <= _ALIKE * max(a, b) for a, b in zip(values, other)) for other in drawn.values()]
        if any(values) and not any(alike):
            drawn[error] = values
    result = []
    for error in drawn:
        words = [*line[0].line]
        if "@" in error:
            words.append(f"t = {error.split('@')[1]} s")
        elif "." in error and len(drawn) > 1:
            words.append(words_of(error))
        result.append(Curve(line, error, ", ".join(words)))
    return result


def _style(number: int) -> dict[str, Any]:
    return {"color": f"C{number % 10}", "marker": MARKERS[number % len(MARKERS)]}


def _looks(curves: list[Curve]) -> dict[str, dict[str, Any]]:
    """A colour and a marker for each name of the legend, the same in all panels."""
    names = dict.fromkeys(curve.text for curve in curves)
    return {name: _style(number) for number, name in enumerate(names)}


def _panel(name: str) -> str:
    """The panel of an error: its name without the time, or one panel for all probes."""
    field = name.split("@", maxsplit=1)[0]
    return "probe" if "." in field else words_of(field)


def _draw(place: Any, curve: Curve, look: dict[str, Any], abscissa: Abscissa) -> list[tuple[float, float]]:
    """Draw a curve, and that of another code dotted with hollow markers; returns the points of the curve."""
    points = _positive((abscissa.value(case), case.measures["errors"].get(curve.error)) for case in curve.line)
    if not points:
        return []
    place.plot(*zip(*points), "-", markersize=4.5, linewidth=1.3, label=curve.text, **look)
    other_code = _positive((abscissa.other_code(case), case.other_code.get(curve.error)) for case in curve.line)
    if other_code:
        hollow = {"markersize": 7, "markerfacecolor": "none", "linewidth": 0.8}
        place.plot(*zip(*other_code), ":", **hollow, **look)
        place.plot([], [], ":", color="0.3", marker="o", label=_OTHER_CODE, **hollow)
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


def label_decades(axis: Any) -> None:
    """Label a logarithmic axis at 1, 2 and 5 of each decade, or at 1 only if it spans many decades."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0) if high < _DECADES * low else (1.0,)))
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(ticker.NullFormatter())
    axis.set_tick_params(labelsize=8.5)


def draw_pareto(plan: Plan, reference: Reference, edge: list[Any], path: Path) -> Path:
    """Draw error against processor seconds, a line per option, and the lower envelope; returns the file."""
    figure = Figure(figsize=(9.0, 5.2), layout="constrained")
    axes = figure.subplots()
    axes.plot([point[0] for point in edge], [point[1] for point in edge], label="lower envelope", **_ENVELOPE)
    shown, others = _labelled(plan, edge)
    for number, one in enumerate(shown):
        color, width = (f"C{number - 1}", 1.3) if number else ("black", 2.2)
        style: dict[str, Any] = {"marker": MARKERS[number], "markersize": 4.5, "linewidth": width, "color": color}
        axes.plot(one.times, one.errors, label=one.option.name, zorder=2 if number else 3, **style)
    for number, one in enumerate(others):
        style = {"marker": "." if len(one.errors) == 1 else "", "color": "0.7", "linewidth": 0.8, "zorder": 1}
        axes.plot(one.times, one.errors, label=None if number else "other choices", **style)
    if reference.uncertain:
        axes.axhspan(0.0, reference.uncertain, color="0.93", zorder=-1, label="not known better than this")
    axes.set(xscale="log", yscale="log", xlabel="processor seconds of the time loop, all ranks")
    axes.set(ylabel=f"error of {words_of(plan.column)}", title=plan.scene.title)
    label_decades(axes.xaxis)
    axes.grid(True, which="both", alpha=0.25)
    figure.legend(loc="outside right upper", fontsize=8, frameon=False)
    figure.savefig(path, dpi=_DOTS_PER_INCH)
    return path


def _labelled(plan: Plan, edge: list[Any]) -> tuple[list[Configuration], list[Configuration]]:
    """Options with a colour and a label, and all others: labelled are the unchanged scene, then options on the
    envelope, then those with most levels and least error."""
    unchanged = plan.configurations[0]
    on_envelope = {id(point[2]) for point in edge}
    options = [one for one in plan.configurations if one.errors and one is not unchanged]
    options.sort(key=lambda one: (id(one) not in on_envelope, -len(one.errors), one.errors[-1]))
    return [unchanged, *options[: MOST_CURVES - 1]], options[MOST_CURVES - 1 :]


def draw_comparisons(title: str, rows: list[Row], path: Path) -> Path:
    """Draw computed over published values: a point per row with its error bar, and a band of the published scatter.

    Rows without a computed value, or with a published value of 0 or none, are left out.
    """
    shown = [row for row in rows if row.reference and row.computed is not None]
    methods = list(dict.fromkeys(row.method for row in shown))
    names = [f"{row.case}: {row.quantity}" for row in shown]
    places = {name: number for number, name in enumerate(dict.fromkeys(names))}
    size = (9.0, 1.6 + 0.32 * len(places) + 0.08 * len(methods))
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots()
    axes.axvspan(1.0 - SHARE, 1.0 + SHARE, color="0.94", zorder=-2)
    axes.axvline(1.0, color="0.6", linewidth=0.8, zorder=-1)
    for row, name in zip(shown, names):
        number = methods.index(row.method)
        y, scale = places[name] + 0.5 * (number + 0.5) / len(methods) - 0.25, abs(float(row.reference or 1.0))
        if row.scatter:
            span: dict[str, Any] = {"linewidth": 5.0, "color": "0.75", "zorder": 0, "solid_capstyle": "butt"}
            axes.plot([1.0 - row.scatter / scale, 1.0 + row.scatter / scale], [places[name]] * 2, **span)
        ratio, bar = float(row.computed or 0.0) / float(row.reference or 1.0), (row.bar or 0.0) / scale
        axes.errorbar(ratio, y, xerr=bar, capsize=3, markersize=5, linestyle="none", **_style(number))
    for number, method in enumerate(methods):
        axes.plot([], [], linestyle="none", label=method, **_style(number))
    axes.set_yticks(list(places.values()), [*places], fontsize=8)
    # the axis is limited by the points: long bars leave the picture
    ratios = [float(row.computed or 0.0) / float(row.reference or 1.0) for row in shown]
    edges = min(0.75, min(ratios) - 0.1), max(1.25, max(ratios) + 0.1)
    axes.set(xlim=edges, ylim=(len(places) - 0.5, -0.5), xlabel="computed over published", title=title)
    axes.grid(True, axis="x", alpha=0.25)
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    figure.savefig(path, dpi=_DOTS_PER_INCH)
    return path


def draw_costs(rows: list[Row], path: Path) -> Path:
    """Draw errors against processor seconds: a panel per case with published values or per line of runs with errors, a
    curve per row of two or more resolutions.
    """
    panels: dict[str, list[tuple[str, list[tuple[float, float]]]]] = {}
    for row in rows:
        points = row.errors()
        if len(points) > 1:
            published = row.reference is not None
            text = f"{row.line}: {row.quantity}" if published else row.quantity
            panels.setdefault(row.case if published else row.line, []).append((text, points))
    figure, places = _log_panels(len(panels), 3, (4.6, 3.6), TIME.label)
    for (title, curves), place in zip(panels.items(), places):
        for number, (text, points) in enumerate(curves):
            place.plot(*zip(*points), "-", markersize=4.5, linewidth=1.3, label=text, **_style(number))
        place.set_title(title, fontsize=9)
        place.legend(fontsize=6.5, loc="upper center", bbox_to_anchor=(0.5, -0.2), frameon=False)
        label_decades(place.xaxis)
    figure.savefig(path, dpi=_DOTS_PER_INCH)
    return path
