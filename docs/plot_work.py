"""Error against core-seconds of docs/weights.md: `python docs/plot_work.py STUDY.CSV [STUDY.CSV ...] -o PICTURE`.

STUDY.CSV are tables of the studies runs/tlsph/studies/work.toml or weights.toml. An error is the largest one of kinetic
energy, internal dissipation and probe (of the plate: of velocity and stress). The points of other programs are given
numbers, and so are, beside work.toml, those of the kernel's weights with SSP-RK3 of the time when the work was asked
for: core-seconds until kinetic energy and tip are both within an error.
"""

import argparse
import csv
from collections import defaultdict
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from parsolid.campaign.pictures import MARKERS, label_decades

ERRORS = (
    *("kinetic", "material_dissipation", "tip.twist", "tip.displacement_x", "corner.displacement_y"),
    *("velocity@0.0047", "first_piola_kirchhoff_stress@0.0047"),
)
FORMER = "kernel, SSP-RK3, before"
# of a panel: its series, and others' (core-seconds, error in percent)
PANELS = {
    "small torsion": (
        ("torsion", "torsion, graded"),
        {
            FORMER: ((0.29, 5), (4.5, 2), (38, 1)),
            "SPHinXsys": ((1.3, 5), (9.4, 2)),
            "LAMMPS MACHDYN": ((9.1, 5),),
        },
    ),
    "small bending": (
        ("bending", "bending, even", "bending, graded", "bending, edges"),
        {
            FORMER: ((0.68, 5), (6.2, 2), (40, 1.1)),
            "SPHinXsys": ((28, 5),),
            "LAMMPS MACHDYN": ((3.3, 5),),
        },
    ),
    "twist at 105 rad/s, to .25 s": (
        ("twist", "twist, graded"),
        {FORMER: ((0.42, 10), (2.4, 5), (50, 2)), "SPHinXsys": ((1.4, 10), (16, 5))},
    ),
    "twisting column, beta 1": (("column, beta 1", "column, beta 1, graded"), {}),
    "punch, beta 3": (("punch, beta 3",), {}),
    "tensile test, beta 3": (("tensile, beta 3",), {}),
    "tensile test, smooth start, beta 3": (("tensile smooth, beta 3",), {}),
    "manufactured plate, t = .0047 s": (("manufactured plate",), {}),
}
MARKS = {FORMER: "k*", "SPHinXsys": "C7X", "LAMMPS MACHDYN": "C8P"}
# a choice of weights has one colour, the integrators a line each
COLOURS = {"kernel": "C0", "closure": "C1", "cells": "C2", "fourth-order": "C3"}
LINES = {"ssp-rk3": "--", "leapfrog": "-"}


def points(tables: list[Path]) -> dict[tuple[str, str], list[tuple[float, float]]]:
    """(processor seconds, error in percent) of every series and line of it, least dissipation last."""
    found = defaultdict(list)
    for table in tables:
        with table.open(newline="") as file:
            for row in csv.DictReader(file):
                errors = [float(row[f"error {name}"]) for name in ERRORS if row.get(f"error {name}")]
                if not errors:
                    continue
                choice = ", ".join(row[key] for key in ("weights", "integrator") if row.get(key))
                factor = f", S = {row['dissipation']}" if row.get("dissipation") else ""
                point = float(row["processor_seconds"]), 100.0 * max(errors)
                found[row["series"], choice or row["series"] + factor].append(point)
    return found


def look_of(line: str, mark: str) -> dict[str, str]:
    """Of a choice of weights and integrator, or of a line that is none."""
    weights, _, integrator = line.partition(", ")
    if weights not in COLOURS:
        return {"marker": mark}
    marker = {"ssp-rk3": "o", "leapfrog": "s"}[integrator]
    return {"marker": marker, "color": COLOURS[weights], "linestyle": LINES[integrator]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tables", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    found = points(given.tables)
    shown = {title: panel for title, panel in PANELS.items() if any(name in panel[0] for name, _ in found)}
    rows = -(-len(shown) // 2)
    figure = Figure(figsize=(12, 4.2 * rows), layout="constrained")
    for axes, (title, (series, others)) in zip(figure.subplots(rows, 2, squeeze=False).flat, shown.items()):
        drawn = [key for key in found if key[0] in series]
        for key, mark in zip(drawn, MARKERS):
            axes.loglog(*zip(*sorted(found[key])), **look_of(key[1], mark), markersize=4.5, label=key[1])
        for name, given_points in others.items():
            axes.loglog(*zip(*given_points), MARKS[name], linestyle=":", label=name)
        axes.set(title=title, xlabel="core-seconds of the loop", ylabel="largest error [%]")
        axes.grid(which="both", alpha=0.2)
        for axis in (axes.xaxis, axes.yaxis):
            label_decades(axis)
        axes.legend(fontsize=7, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    FigureCanvasAgg(figure).print_png(given.output, metadata={"Software": None})


if __name__ == "__main__":
    main()
