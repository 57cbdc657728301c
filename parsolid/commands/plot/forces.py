"""Forces of supports and driven surfaces against the displacement of their region."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from parsolid.commands.plot.scales import prefixed
from parsolid.output.results import Results

_COLOURS = dict(zip("xyz", ("#1f77b4", "#d95f02", "#1b9e77")))


def pairs(tables: dict[str, Any], columns: list[str]) -> dict[str, list[tuple[str, str]]]:
    """Boundary -> columns (displacement, force) of each axis: of boundaries that tell their force, in a region whose
    displacement a probe has."""
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
    """One panel a boundary; False, and no file, where there is nothing to draw."""
    history = results.columns
    panels = pairs(results.scene, list(history))
    if not panels:
        return False
    figure = Figure(figsize=(4.6 * len(panels), 3.6), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(results.title, fontsize=12)
    for axes, (name, both) in zip(np.atleast_1d(figure.subplots(1, len(panels))).ravel(), panels.items()):
        moved, force = ([np.abs(history[one[k]]).max(initial=0.0) for one in both] for k in (0, 1))
        (length, metres), (unit, newtons) = prefixed("m", max(moved)), prefixed("N", max(force))
        for (along, across), size in zip(both, moved):
            # what does not move has no curve
            if size > 1e-9 * max(moved):
                axis = along[-1]
                axes.plot(history[along] / length, history[across] / unit, color=_COLOURS[axis], label=axis.upper())
        axes.set_title(name, fontsize=10)
        axes.set_xlabel(f"mean displacement [{metres}]")
        axes.set_ylabel(f"force on the body [{newtons}{results.per(name)}]")
        axes.grid(alpha=0.25, linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(fontsize=9, framealpha=0.75, edgecolor="none")
    figure.savefig(path, dpi=figure.dpi)
    return True
