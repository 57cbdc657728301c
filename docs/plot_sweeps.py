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

from parsolid.campaign.pictures import MARKERS, label_decades
from parsolid.commands.plot.marks import add_marks
from parsolid.commands.plot.scales import _convention
from parsolid.output.history import read_history

PANELS = (
    ("midpoint.plastic_strain", "plastic strain at the midpoint", 1.0),
    ("midpoint.temperature", "temperature at the midpoint [K]", 1.0),
    ("micro.micro_kinetic", "micro-kinetic energy [kJ/m]", 1e3),
)
LENGTHS = {f"{value}-mm-2": f"$l_m^2$ = {value} mm²" for value in ("0.1", "1", "10", "100")}
RELAXATIONS = {"1e-6": "1 µs", "9e-6": "9 µs", "9e-5": "90 µs", "9e-4": "900 µs"}
TIMES = {f"{value}-s": rf"$t_\pi$ = {words}" for value, words in RELAXATIONS.items()}
# field, title, range
FIELDS = (("plastic_strain", "plastic strain", (0.0, 1.0)), ("temperature", "temperature [K]", (298.0, 480.0)))
STYLES = ("-", "--", "-.", ":")
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
        for (place, label), style, mark in zip(places.items(), STYLES, MARKERS):
            history = history_of(study, f"{series}-{place}")
            marked = {"marker": mark, "markevery": 0.15, "markersize": 4}
            axes.plot(history["time"] * 1e6, history[column] / unit, style, label=label, **marked)
        axes.set(xlabel="time [µs]", ylabel=words)
        axes.legend(fontsize=8, frameon=False)


def draw_speeds(row: Any, study: Path) -> None:
    """Largest |S|, mean gamma and greatest temperature over the impact speed."""
    histories = [history_of(study, f"impact-speed-{speed}-m-s") for speed in SPEEDS]
    largest = (
        np.array([np.sqrt(2.0 / 3.0) * history["largest.maximum_von_mises_stress"].max() for history in histories])
        / 1e9
    )
    row[0].loglog(SPEEDS, largest, "o", label="largest")
    slope = largest[0] / SPEEDS[0]
    row[0].loglog(SPEEDS, slope * np.array(SPEEDS), "k:", label=f"{1e3 * slope:.1f} MPa per m/s")
    row[0].set(xlabel="impact speed [m/s]", ylabel="largest stress deviator [GPa]")
    row[0].legend(fontsize=8, frameon=False)
    for axis in (row[0].xaxis, row[0].yaxis):
        label_decades(axis)
    for axes, column, words in (
        (row[1], "mean.mean_plastic_strain", "mean plastic strain at 20 µs"),
        (row[2], "hottest.maximum_temperature", "largest temperature at 20 µs [K]"),
    ):
        axes.plot(SPEEDS, [history[column][-1] for history in histories], "o-")
        axes.set(xlabel="impact speed [m/s]", ylabel=words)


def profiles(study: Path) -> Figure:
    """Plastic strain and temperature at the end, for each l_m^2, in the colours of all pictures."""
    size, pixels = (1200, 690), 10.0
    figure = Figure(figsize=(size[0] / 100, size[1] / 100), dpi=100)
    FigureCanvasAgg(figure)
    # a picture of each field beside the other, each with its colours below
    for column, (field, words, (lower, upper)) in enumerate(FIELDS):
        left = 20 + 560 * column
        for number, (place, label) in enumerate(LENGTHS.items()):
            points, values = last_fields(study, f"inertia-length-{place}", field)
            box = (left, size[1] - 152 * (number + 1), 520, 150)
            axes = figure.add_axes((box[0] / size[0], box[1] / size[1], box[2] / size[0], box[3] / size[1]))
            axes.set(xlim=(-0.6, 51.4), ylim=(-4.2, 10.8), aspect="equal")
            axes.set_axis_off()
            colours = {"cmap": _convention(field)[0], "vmin": lower, "vmax": upper}
            # 0.36 mm wide at first, drawn out by up to a half
            side = 0.54 * pixels * 72 / 100
            drawn = axes.scatter(*points[:, :2].T * 1e3, c=values, s=side * side, marker="s", linewidths=0, **colours)
            axes.text(1.5, -4.0, f"{label}, t = 40 µs", va="bottom", fontsize=9)
        bar = figure.add_axes(((left + 110) / size[0], 50 / size[1], 300 / size[0], 12 / size[1]))
        figure.colorbar(drawn, cax=bar, orientation="horizontal", extend="max", label=words)
    add_marks(figure, size[0] - 110, size, np.eye(2), 1e3 * pixels)
    return figure


def curves(sweeps: Path, extreme: Path) -> Figure:
    """The midpoint over time by l_m^2 and t_pi, and what grows with the impact speed."""
    figure = Figure(figsize=(12.0, 9.5), dpi=80, layout="constrained")
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
    figure.savefig(path)
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
