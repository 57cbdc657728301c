"""Curves of the sweeps of docs/microinertia.md: `python docs/plot_sweeps.py SWEEPS EXTREME -o PICTURE`.

SWEEPS and EXTREME are the folders of the studies runs/ulsph/studies/sweeps.toml and stiff_and_extreme.toml.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from parsolid.output.history import read_history

PANELS = (
    ("midpoint.plastic_strain", "gamma at the midpoint", 1.0),
    ("midpoint.temperature", "T at the midpoint [K]", 1.0),
    ("micro.micro_kinetic", "micro-kinetic energy [kJ/m]", 1e3),
)
SPEEDS = (25, 50, 100, 150, 208, 300, 400, 600, 800, 1000)


def history_of(study: Path, run: str) -> dict[str, np.ndarray]:
    """The history (rows,) by column of a study's run whose folder starts with a name."""
    (folder,) = (path for path in (study / "runs").iterdir() if path.name.startswith(f"{run}-"))
    return {name: np.array(values) for name, values in read_history(folder / "history.csv").items()}


def draw_sweep(row: Any, study: Path, series: str, places: dict[str, str]) -> None:
    """The panels of a sweep; places: the folder's words for a run, and the label of its curve."""
    for (column, words, unit), axes in zip(PANELS, row):
        for place, label in places.items():
            history = history_of(study, f"{series}-{place}")
            axes.plot(history["time"] * 1e6, history[column] / unit, label=label)
        axes.set(xlabel="t [us]", ylabel=words)
        axes.legend(fontsize=8)


def draw_speeds(row: Any, study: Path) -> None:
    """Largest |S|, mean gamma and greatest temperature over the impact speed."""
    histories = [history_of(study, f"impact-speed-{speed}-m-s") for speed in SPEEDS]
    largest = np.array([history["largest.maximum_deviator_norm"].max() for history in histories]) / 1e9
    row[0].loglog(SPEEDS, largest, "o", label="largest |S|")
    slope = largest[0] / SPEEDS[0]
    row[0].loglog(SPEEDS, slope * np.array(SPEEDS), "k:", label=f"{1e3 * slope:.1f} MPa per m/s")
    row[0].set(xlabel="v0 [m/s]", ylabel="tau_max [GPa]")
    row[0].legend(fontsize=8)
    for axes, column, words in (
        (row[1], "mean.mean_plastic_strain", "mean gamma at 20 us"),
        (row[2], "hottest.maximum_temperature", "largest T at 20 us [K]"),
    ):
        axes.plot(SPEEDS, [history[column][-1] for history in histories], "o-")
        axes.set(xlabel="v0 [m/s]", ylabel=words)


def main() -> None:
    """Draw the curves."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sweeps", type=Path)
    parser.add_argument("extreme", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    figure = Figure(figsize=(12.0, 9.5), layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.subplots(3, 3)
    lengths = {f"{value}-mm-2": f"l_m^2 = {value} mm^2" for value in ("0.1", "1", "10", "100")}
    draw_sweep(rows[0], options.sweeps, "inertia-length", lengths)
    times = {f"{value}-s": f"t_pi = {value} s" for value in ("1e-6", "9e-6", "9e-5", "9e-4")}
    draw_sweep(rows[1], options.sweeps, "relaxation-of-the-micro-stress", times)
    draw_speeds(rows[2], options.extreme)
    for axes in rows.flat:
        axes.grid(visible=True, alpha=0.25)
    figure.savefig(options.output, dpi=80)


if __name__ == "__main__":
    main()
