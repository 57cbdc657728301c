"""Error against core-seconds of docs/weights.md: `python docs/plot_work.py STUDY.CSV [STUDY.CSV ...] -o PICTURE`.

STUDY.CSV are tables of the study runs/tlsph/studies/work.toml. An error is the larger one of kinetic energy and tip.
The points of other programs, and of the kernel's weights with SSP-RK3, are given numbers: core-seconds until both are
within an error.
"""

import argparse
import csv
from collections import defaultdict
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from parsolid.commands.study.pictures import MARKERS, label_decades

# of a panel: its series, and others' (core-seconds, error in percent)
PANELS = {
    "small torsion": (
        ("torsion", "torsion, graded"),
        {
            "kernel, SSP-RK3": ((0.29, 5), (4.5, 2), (38, 1)),
            "SPHinXsys": ((1.3, 5), (9.4, 2)),
            "LAMMPS MACHDYN": ((9.1, 5),),
        },
    ),
    "small bending": (
        ("bending, even", "bending, graded", "bending, edges"),
        {
            "kernel, SSP-RK3": ((0.68, 5), (6.2, 2), (40, 1.1)),
            "SPHinXsys": ((28, 5),),
            "LAMMPS MACHDYN": ((3.3, 5),),
        },
    ),
    "twist at 105 rad/s, to .25 s": (
        ("twist", "twist, graded"),
        {"kernel, SSP-RK3": ((0.42, 10), (2.4, 5), (50, 2)), "SPHinXsys": ((1.4, 10), (16, 5))},
    ),
    "twisting column, beta 1": (("column, beta 1", "column, beta 1, graded"), {}),
}
# corners for the legends
FREE = {"small torsion": "lower right", "small bending": "lower left"}
MARKS = {"kernel, SSP-RK3": "k*", "SPHinXsys": "C7X", "LAMMPS MACHDYN": "C8P"}


def points(tables: list[Path]) -> dict[str, list[tuple[float, float]]]:
    """(processor seconds, error in percent) of every series, least dissipation last."""
    found = defaultdict(list)
    for table in tables:
        with table.open(newline="") as file:
            for row in csv.DictReader(file):
                errors = [row.get(name) for name in ("error kinetic", "error tip.twist", "error tip.displacement_x")]
                largest = max(float(error) for error in errors if error)
                factor = row.get("dissipation", "")
                name = f"{row['series']}, S = {factor}" if factor else row["series"]
                found[name].append((float(row["processor_seconds"]), 100.0 * largest))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tables", nargs="+", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    found, figure = points(given.tables), Figure(figsize=(11, 8), layout="constrained")
    for axes, (title, (series, others)) in zip(figure.subplots(2, 2).flat, PANELS.items()):
        drawn = [name for name in found if name.split(", S =")[0] in series]
        for name, mark in zip(drawn, MARKERS):
            axes.loglog(*zip(*sorted(found[name])), f"{mark}-", markersize=4.5, label=name)
        for name, given_points in others.items():
            axes.loglog(*zip(*given_points), MARKS[name], linestyle=":", label=name)
        axes.set(title=title, xlabel="core-seconds of the loop", ylabel="largest error of kinetic energy and tip [%]")
        axes.grid(which="both", alpha=0.2)
        for axis in (axes.xaxis, axes.yaxis):
            label_decades(axis)
        axes.legend(fontsize=7, frameon=False, loc=FREE.get(title, "upper right"))
    FigureCanvasAgg(figure).print_png(given.output, metadata={"Software": None})


if __name__ == "__main__":
    main()
