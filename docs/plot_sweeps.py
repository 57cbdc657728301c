"""Curves and profiles of the sweeps of docs/microinertia.md: `python docs/plot_sweeps.py SWEEPS EXTREME -o FOLDER`.

SWEEPS and EXTREME are the folders of the studies runs/ulsph/studies/sweeps.toml and stiff_and_extreme.toml.
"""

import argparse
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from parsolid.output.history import read_history

PANELS = (
    ("midpoint.plastic_strain", "gamma at the midpoint", 1.0),
    ("midpoint.temperature", "T at the midpoint [K]", 1.0),
    ("micro.micro_kinetic", "micro-kinetic energy [kJ/m]", 1e3),
)
LENGTHS = {f"{value}-mm-2": f"l_m^2 = {value} mm^2" for value in ("0.1", "1", "10", "100")}
TIMES = {f"{value}-s": f"t_pi = {value} s" for value in ("1e-6", "9e-6", "9e-5", "9e-4")}
SPEEDS = (25, 50, 100, 150, 208, 300, 400, 600, 800, 1000)


def folder_of(study: Path, run: str) -> Path:
    """The folder of a study's run that starts with a name."""
    (folder,) = (path for path in (study / "runs").iterdir() if path.name.startswith(f"{run}-"))
    return folder


def history_of(study: Path, run: str) -> dict[str, np.ndarray]:
    """The history (rows,) of a run by column."""
    return {name: np.array(values) for name, values in read_history(folder_of(study, run) / "history.csv").items()}


def last_fields(study: Path, run: str, *names: str) -> list[np.ndarray]:
    """Places (n, 3) [m] and fields (n,) of a run's last written time."""
    with h5py.File(folder_of(study, run) / "fields.vtkhdf") as file:
        root = file["VTKHDF"]
        count = int(root["NumberOfPoints"][-1])
        return [root[name][-count:] for name in ("Points", *(f"PointData/{name}" for name in names))]


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


def profiles(study: Path) -> Figure:
    """gamma and T at the end, for each l_m^2."""
    figure = Figure(figsize=(12.0, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.subplots(len(LENGTHS), 2)
    for row, (place, label) in zip(rows, LENGTHS.items()):
        points, strain, temperature = last_fields(study, f"inertia-length-{place}", "plastic_strain", "temperature")
        for axes, values, words, range_ in (
            (row[0], strain, "gamma", (0.0, 1.0)),
            (row[1], temperature, "T [K]", (298.0, 480.0)),
        ):
            drawn = axes.scatter(*points[:, :2].T * 1e3, c=values, s=3, cmap="turbo", vmin=range_[0], vmax=range_[1])
            axes.set(aspect="equal", title=label, xlim=(0.0, 50.8), ylim=(-4.0, 11.62))
            figure.colorbar(drawn, ax=axes, label=words)
    return figure


def curves(sweeps: Path, extreme: Path) -> Figure:
    """The midpoint over time by l_m^2 and t_pi, and what grows with the impact speed."""
    figure = Figure(figsize=(12.0, 9.5), layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.subplots(3, 3)
    draw_sweep(rows[0], sweeps, "inertia-length", LENGTHS)
    draw_sweep(rows[1], sweeps, "relaxation-of-the-micro-stress", TIMES)
    draw_speeds(rows[2], extreme)
    for axes in rows.flat:
        axes.grid(visible=True, alpha=0.25)
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a picture of 256 colours."""
    figure.savefig(path, dpi=80)
    Image.open(path).convert("RGB").quantize(256).save(path, optimize=True)


def main() -> None:
    """Write microinertia-profiles.png and microinertia-sweeps.png."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sweeps", type=Path)
    parser.add_argument("extreme", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    options = parser.parse_args()
    save(profiles(options.sweeps), options.output / "microinertia-profiles.png")
    save(curves(options.sweeps, options.extreme), options.output / "microinertia-sweeps.png")


if __name__ == "__main__":
    main()
