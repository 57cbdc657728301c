"""Errors that were asked for and what came of it: docs/error-bars.md, by `python benchmarks/targets.py`."""

import argparse
import contextlib
import io
import json
import re
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.interpolate import CubicSpline

from parsolid.api.running import run_scene
from parsolid.commands.cli import parse
from parsolid.commands.run import options_of
from parsolid.output.results import load
from parsolid.scene import load_scene

ROOT = Path(__file__).parents[1]
QUICK = ("output.pictures=false", "output.fields_times=[]")
# scene, overrides, column, bars asked for [%]
CASES = [
    ("tlsph/tensile_smooth", ("bodies.0.particles=[25, 25]",), "corner.displacement_y", (20, 10, 5)),
    ("tlsph/tensile_smooth", ("bodies.0.particles=[25, 25]",), "kinetic", (5, 2, 1)),
    ("tlsph/tensile_smooth", ("bodies.0.particles=[25, 25]",), "strain_energy", (5, 2, 1)),
    ("tlsph/punch", ("bodies.0.particles=[25, 25]",), "kinetic", (4, 2, 1)),
    ("tlsph/punch", ("bodies.0.particles=[25, 25]",), "strain_energy", (4, 2, 1)),
    ("tlsph/punch", ("bodies.0.particles=[25, 25]",), "material_dissipation", (4, 2)),
    ("tlsph/tensile", ("bodies.0.particles=[25, 25]",), "strain_energy", (20, 10)),
    ("tlsph/torsion", ("bodies.0.particles=[7, 37, 7]", "end_time=0.06"), "tip.twist", (10,)),
]


def true_share(folder: Path, scene: str, column: str) -> str:
    """The true error at the end over the largest value, where the scene has a series for the column."""
    found = load_scene(ROOT / "runs" / f"{scene}.toml")
    name = (found.reference.columns or {}).get(column) if found.reference else None
    if name is None:
        return ""
    data = json.loads(Path(found.reference.series).read_text())
    history = load(folder).columns
    values = history[column]
    error = abs(values[-1] - CubicSpline(data["t"], data["series"][name])(history["time"][-1]))
    return f"{100 * error / np.abs(values).max():.2g} %"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("-o", default="results/targets")
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    print("| scene, column | asked | bar reached | true error | lattice | core-s | predicted | ratio |")
    print("|---|---:|---:|---:|---|---:|---:|---:|")
    for scene, overrides, column, asked in CASES:
        for percent in asked if options.only in scene else ():
            folder = Path(options.o) / scene.replace("/", "-")
            file = str(ROOT / "runs" / f"{scene}.toml")
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                parsed = parse(["run", file, "-o", str(folder), "--target", f"{column}={percent}%"])
                stated = load_scene(file, [*overrides, *QUICK])
                run_scene(MPI.COMM_WORLD, stated, Path(parsed.output), options_of(parsed), 0.0)
            text = said.getvalue()
            end = re.search(r"reached with (.*) after (\S+) core-s in (\S+)", text)
            shares = re.findall(r"\(([\d.e+-]+) % of its largest\)", text)
            costs = re.findall(r"target: [\dx ]+: (\S+) core-s(?:, (\S+) were predicted)?", text)
            last = costs[-1]
            ratio = f"{float(last[0]) / float(last[1]):.2f}" if last[1] else ""
            true = true_share(Path(end[3]), scene, column) if end else ""
            reached = f"{shares[-1]} %" if end else text.splitlines()[-1]
            lattice = end[1] if end else ""
            row = [f"{scene}, {column}", f"{percent} %", reached, true, lattice, last[0], last[1], ratio]
            print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
