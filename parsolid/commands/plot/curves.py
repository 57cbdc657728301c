"""Curves of a run: energies, dissipations, energy error and probes over time, with the scene's reference; forces over
displacements of boundaries; fields over a coordinate.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure

from parsolid.commands.plot.scales import prefixed, time_labels
from parsolid.output.results import Results
from parsolid.output.words import labelled, unit_of, words_of
from parsolid.scene.observation import DISSIPATIONS, ENERGIES, stored_energy

DOTS_PER_INCH = 100
_COLOURS = {
    "kinetic": "#1f77b4",
    "strain_energy": "#d95f02",
    "internal_energy": "#d95f02",
    "total": "#222222",
    "material_dissipation": "#7570b3",
    "numerical_dissipation": "#1b9e77",
    "external_work": "#a6761d",
    "fracture_dissipation": "#e7298a",
    "failure_dissipation": "#e7298a",
    "plastic_work": "#e6ab02",
    "viscous_work": "#66a61e",
    "viscous_dissipation": "#66a61e",
    "friction_dissipation": "#8c564b",
    "heat_supplied": "#d62728",
    "heat_stored": "#ff9896",
    "contact_energy": "#17becf",
    "stick_energy": "#9edae5",
    "tie_energy": "#5254a3",
}
_PALETTE = ("#1f77b4", "#d95f02", "#1b9e77", "#7570b3", "#e7298a", "#a6761d", "#66a61e", "#666666", "#17becf")
_MARKERS = "osD^vPX*<"
# parts of the stored energy -> labels
_PARTS = {
    "contact_energy": "contact energy",
    "stick_energy": "energy of friction's springs",
    "tie_energy": "energy of ties",
}
# largest number of curves in a panel; a curve is drawn if it exceeds these shares of the largest energy and of the
# largest curve of its panel
_MOST, _NOTHING, _FLAT = 8, 1e-6, 5e-3
_REFERENCE = {"linestyle": (0, (4, 3)), "linewidth": 1.2, "color": "black", "alpha": 0.75}
_PANEL = (460, 330)


def write_energies(results: Results, path: Path) -> None:
    """Draw energies, dissipations and the energy error over time, side by side."""
    history = results.columns
    factor, seconds = prefixed("s", _last(history["time"]))
    time = history["time"] / factor
    stored = stored_energy(history)
    terms = {name: history[name] for name in ENERGIES if name in history} | _method_terms(history)
    largest = max((np.nanmax(np.abs(values)) for values in terms.values() if len(values)), default=0.0)
    unit, prefix = prefixed("J", largest)
    figure = _figure((3 * _PANEL[0], _PANEL[1] + 30), results.title)
    energies, dissipations, error = figure.subplots(1, 3)
    shown = [name for name, values in terms.items() if _largest(values) > _NOTHING * largest]
    for name in ("kinetic", stored, "external_work"):
        if name in shown:
            energies.plot(time, terms[name] / unit, color=_COLOURS[name], label=words_of(name))
    total = terms["kinetic"] + terms[stored]
    if {"kinetic", stored} <= set(shown):
        label = f"kinetic + {words_of(stored)}"
        energies.plot(time, total / unit, color=_COLOURS["total"], label=label, linewidth=1.0)
    for name, label in _PARTS.items():
        if name in shown and _largest(terms[name]) > _FLAT * largest:
            # columns begin at 0 even if bodies are in contact at the start
            if np.nanmin(terms[name]) < -_FLAT * largest:
                label = f"change of {label}"
            energies.plot(time, terms[name] / unit, color=_COLOURS[name], label=label, linewidth=1.0)
    others = [name for name in (*DISSIPATIONS, *_method_terms(history)) if name in shown and name not in _PARTS]
    tallest = max((_largest(terms[name]) for name in others), default=0.0)
    others = [name for name in others if _largest(terms[name]) > _FLAT * tallest]
    spare = iter(_PALETTE[5:])
    for name in _most(others, terms):
        colour = _COLOURS.get(name) or next(spare)
        dissipations.plot(time, terms[name] / unit, color=colour, label=words_of(name))
    for axes, names in ((energies, ("kinetic", stored)), (dissipations, DISSIPATIONS)):
        _add_references(axes, results, names, factor, unit)
        _add_bands(axes, results, names, time, unit, _COLOURS)
    error.plot(time, history["energy_error"] / (largest or 1.0), color="#222222")
    energies.set_ylabel(f"energy [{prefix}]")
    dissipations.set_ylabel(f"dissipated [{prefix}]")
    error.set_ylabel("energy error / largest energy")
    _finish((energies, dissipations, error), seconds)
    error.ticklabel_format(axis="y", style="sci", scilimits=(-2, 2))
    figure.savefig(path, dpi=DOTS_PER_INCH)


def _method_terms(history: dict[str, Any]) -> dict[str, Any]:
    """Energy terms of the method: the columns between external work and energy error."""
    columns = list(history)
    first, last = columns.index("external_work") + 1, columns.index("energy_error")
    return {name: history[name] for name in columns[first:last]}


def write_probes(results: Results, path: Path) -> bool:
    """Draw a panel per field of each probe; False, and no file, without probes."""
    history = results.columns
    idle = {name for name in history if name.endswith(".work") and _largest(history[name]) == 0.0}
    # probe.field -> its columns in the history
    panels: dict[str, list[str]] = {}
    for name in history:
        if "." in name and name not in idle:
            stem, _, part = name.rpartition("_")
            component = "." in stem and part and len(part) <= 2 and set(part) <= set("xyz")
            panels.setdefault(stem if component else name, []).append(name)
    if not panels:
        return False
    factor, seconds = prefixed("s", _last(history["time"]))
    time = history["time"] / factor
    # four are a square
    columns = 2 if len(panels) == 4 else min(len(panels), 3)
    rows = -(-len(panels) // columns)
    figure = _figure((columns * _PANEL[0], rows * (_PANEL[1] - 30) + 60), results.title)
    grid = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    # field -> the largest magnitude of all its panels
    largest: dict[str, float] = {}
    for panel, names in panels.items():
        field = panel.partition(".")[2]
        largest[field] = max([largest.get(field, 0.0), *(_largest(history[name]) for name in names)])
    for axes, (panel, names) in zip(grid, panels.items()):
        probe, _, field = panel.partition(".")
        # the same unit in all panels of a field
        unit, label = prefixed(unit_of(field), largest[field])
        drawn = _distinct(names, history)
        for name in drawn:
            part, k = name[len(panel) :].lstrip("_"), names.index(name)
            marks = {"marker": _MARKERS[k], "markersize": 4, "markevery": (0.02 * k, 0.14)} if len(drawn) > 1 else {}
            axes.plot(time, history[name] / unit, color=_PALETTE[k], label=part or None, **marks)
        _add_references(axes, results, names, factor, unit)
        _add_bands(axes, results, names, time, unit)
        axes.set_title(words_of(probe), fontsize=10)
        per = results.per(probe) if field in ("force", "moment") else ""
        axes.set_ylabel(labelled(words_of(field), label and f"{label}{per}"))
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    _finish(grid[: len(panels)], seconds)
    figure.savefig(path, dpi=DOTS_PER_INCH)
    return True


def _largest(values: np.ndarray) -> float:
    return float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0


def _most(names: list[str], columns: dict[str, Any]) -> list[str]:
    """The _MOST largest columns, in their order."""
    chosen = sorted(names, key=lambda name: -_largest(columns[name]))[:_MOST]
    return [name for name in names if name in chosen]


def _distinct(names: list[str], history: dict[str, np.ndarray]) -> list[str]:
    """The components of a field that are not zero, and one of two components equal by symmetry."""
    largest = max(_largest(history[name]) for name in names)
    kept: list[str] = []
    for name in names:
        values = history[name]
        twin = f"{name[:-2]}{name[:-3:-1]}"
        same = twin in kept and np.allclose(values, history[twin], rtol=0.0, atol=_NOTHING * largest, equal_nan=True)
        if _largest(values) > _NOTHING * largest and not same:
            kept.append(name)
    return _most(kept, history) or names[:1]


def _add_references(axes: Any, results: Results, names: Iterable[str], factor: float, unit: float) -> None:
    """Draw the reference series of these columns; the first one has a label."""
    if results.reference is None:
        return
    times, series = results.reference
    shown = times <= _last(results.columns["time"]) * (1.0 + 1e-9)
    label: str | None = results.reference_name
    for name in names:
        if name in series:
            axes.plot(times[shown] / factor, series[name][shown] / unit, label=label, **_REFERENCE)
            label = None


def _add_bands(
    axes: Any, results: Results, names: Iterable[str], time: np.ndarray, unit: float, colours: Any = None
) -> None:
    """Draw the error bars of these columns as bands; the limits of the axes do not change."""
    shown = axes.get_ylim()
    for name, colour in zip(names, _PALETTE):
        if name in results.errors:
            value, bar = results.columns[name] / unit, results.errors[name] / unit
            colour = colours[name] if colours else colour
            axes.fill_between(time, value - bar, value + bar, color=colour, alpha=0.2, linewidth=0)
    axes.set_ylim(shown)


def _last(time: np.ndarray) -> float:
    return float(time[-1]) if len(time) else 0.0


def _figure(size: tuple[int, int], title: str) -> Figure:
    figure = Figure(figsize=(size[0] / DOTS_PER_INCH, size[1] / DOTS_PER_INCH), dpi=DOTS_PER_INCH, layout="constrained")
    figure.suptitle(title, fontsize=12)
    return figure


def _finish(panels: Any, unit_of_time: str | None = None) -> None:
    """Grid, ticks and legend of panels; unit_of_time: of their abscissa, unless that is not the time."""
    for axes in panels:
        if unit_of_time is not None:
            axes.set_xlabel(f"time [{unit_of_time}]")
            axes.margins(x=0.0)
        axes.grid(alpha=0.25, linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=9)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=9, framealpha=0.75, edgecolor="none")


_SIZE = (640, 420)


def write_lines(
    results: Results, field: str, steps: list[int], path: Path, size: tuple[int, int] | None = None, axis: int = 0
) -> None:
    """Draw a field at some steps into one figure, over the present coordinate `axis` of all particles: curves of a bar,
    points of bodies in the plane and in space, where many particles have the same coordinate.
    """
    look = {"linewidth": 1.1} if results.dimension == 1 else {"linestyle": "none", "marker": ".", "markersize": 3.0}
    frames = list(results.frames(steps, field))
    labels = time_labels([frame.time for frame in frames])
    largest = max((np.nanmax(np.abs(frame.values)) for frame in frames), default=0.0)
    unit, label = prefixed(unit_of(field), largest)
    farthest = max((np.abs(frame.position[:, axis]).max() for frame in frames), default=0.0)
    length, metres = prefixed("m", float(farthest))
    figure = _figure(size or _SIZE, results.title)
    axes = figure.subplots()
    for number, (frame, text) in enumerate(zip(frames, labels)):
        place = frame.position[:, axis]
        order = np.argsort(place)
        colour = colormaps["viridis"](0.9 * number / max(1, len(frames) - 1))
        axes.plot(place[order] / length, frame.values[order] / unit, color=colour, label=text, **look)
    axes.set_xlabel(labelled("xyz"[axis], metres))
    axes.set_ylabel(labelled(words_of(field), label))
    _finish([axes])
    figure.savefig(path, dpi=DOTS_PER_INCH)


_OF_AXES = dict(zip("xyz", ("#1f77b4", "#d95f02", "#1b9e77")))


def pairs(tables: dict[str, Any], columns: list[str]) -> dict[str, list[tuple[str, str]]]:
    """Boundary -> columns (displacement, force) of each axis, for boundaries with a reaction in a region of which a
    probe has the displacement."""
    found: dict[str, list[tuple[str, str]]] = {}
    for boundary in tables.get("boundaries", []):
        if not boundary.get("reaction") or boundary.get("where") is None:
            continue
        for probe in tables.get("probes", []):
            if probe.get("where") == boundary["where"] and "displacement" in (probe.get("fields") or ()):
                names = [(f"{probe['name']}.displacement_{a}", f"{boundary['name']}.force_{a}") for a in "xyz"]
                found.setdefault(boundary["name"], [one for one in names if set(one) <= set(columns)])
    return {name: kept for name, kept in found.items() if kept}


def write_forces(results: Results, path: Path) -> bool:
    """Draw a panel per boundary, force over displacement; False, and no file, without such boundaries."""
    history = results.columns
    panels = pairs(results.scene, list(history))
    if not panels:
        return False
    figure = _figure((_PANEL[0] * len(panels), _PANEL[1] + 30), results.title)
    for axes, (name, both) in zip(np.atleast_1d(figure.subplots(1, len(panels))).ravel(), panels.items()):
        moved, force = ([np.abs(history[one[k]]).max(initial=0.0) for one in both] for k in (0, 1))
        (length, metres), (unit, newtons) = prefixed("m", max(moved)), prefixed("N", max(force))
        for (along, across), size in zip(both, moved):
            # no curve along axes without motion
            if size > 1e-9 * max(moved):
                axis = along[-1]
                axes.plot(history[along] / length, history[across] / unit, color=_OF_AXES[axis], label=axis.upper())
        axes.set_title(name, fontsize=10)
        axes.set_xlabel(f"mean displacement [{metres}]")
        axes.set_ylabel(f"force on the body [{newtons}{results.per(name)}]")
        _finish([axes])
    figure.savefig(path, dpi=DOTS_PER_INCH)
    return True
