"""The twist of the column without viscosity to .25 s by two lattices of fourth order, extrapolated: beside twist.json.

    python runs/tlsph/reference/twist_by_lattices.py RUNS 17 25 > LATTICES.json

RUNS: folder of the runs, which are made where they are not there; then nodes across, of lattices that are 4 (n - 1) + 1
long. Differences between the lattices fall with orders of 1 to 2 (waves as long as the spacing, of which the twist
makes some, are damped on every lattice), so the last two are extrapolated with order 1.5; the uncertainty is what
orders 1 and 2 make of it. A fit to 13, 17 and 25 nodes gave .90, .55 and 1.22: of the stored energy it may be
too small.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

SCENE = Path(__file__).parents[1] / "column.toml"
END, INTERVAL, ORDER = 0.25, 0.0005, 1.5
SETTINGS = (
    *("method.weights=fourth-order", "method.integrator=leapfrog", "method.dissipation=0.5"),
    *("bodies.0.material.branches=[]", f"end_time={END}", f"output.fields_times=[0, {END}]"),
    *(f"output.history_interval={INTERVAL / 2}", "reference.series=reference/column_b0.json"),
)
COLUMNS = {"K": "kinetic", "W": "strain_energy", "twist_C": "tiptwist"}


def history(folder: Path, nodes: int) -> dict[str, np.ndarray]:
    """Of a lattice at equal times."""
    run = folder / f"{nodes}"
    if not (run / "summary.json").exists():
        lattice = f"bodies.0.particles=[{nodes}, {4 * (nodes - 1) + 1}, {nodes}]"
        sets = [part for setting in (*SETTINGS, lattice) for part in ("--set", setting)]
        command = [sys.executable, "-m", "parsolid", "run", str(SCENE), "-o", str(run), *sets]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    rows = np.genfromtxt(run / "history.csv", delimiter=",", names=True)
    t = np.linspace(0.0, END, round(END / INTERVAL) + 1).round(6)
    return {name: np.interp(t, rows["time"], rows[column]) for name, column in COLUMNS.items()} | {"t": t}


def extrapolated(spacings: list[float], series: list[np.ndarray], order: float) -> np.ndarray:
    """From the last two."""
    coarse, fine = (h**order for h in spacings[-2:])
    return series[-1] + (series[-1] - series[-2]) * fine / (coarse - fine)


def main() -> None:
    folder, lattices = Path(sys.argv[1]), [int(n) for n in sys.argv[2:]]
    found, spacings = [history(folder, n) for n in lattices], [1.0 / (n - 1) for n in lattices]
    E0, columns, uncertainty = float(found[0]["K"][0]), {}, {}
    for name in COLUMNS:
        series = [one[name] for one in found]
        low, value, high = (extrapolated(spacings, series, order) for order in (1.0, ORDER, 2.0))
        scale = np.abs(value).max() if name == "twist_C" else E0
        columns[name] = [float(f"{x:.8g}") for x in value]
        uncertainty[name] = float(f"{max(np.abs(one - value).max() for one in (low, high)) / scale:.2g}")
        print(f"{name}: {np.abs(value - series[-1]).max() / scale:.2e} +- {uncertainty[name]}", file=sys.stderr)
    said = (
        "column of 1 x 6 x 1 m, held at Y = 0, velocity 105 sin(pi Y/12) rad/s x X, no viscosity; lattices of fourth "
        f"order and leapfrog, {' and '.join(map(str, lattices))} nodes across, S = .5, extrapolated, order {ORDER}; "
        "uncertainty over E0 and over the largest twist"
    )
    # that the columns of the scene name
    columns["Dint"] = [0.0] * len(found[0]["t"])
    where = {"method": "lattices, extrapolated", "case": "twist", "description": said, "E0": E0}
    print(json.dumps({**where, "t": found[0]["t"].tolist(), "series": columns, "uncertainty": uncertainty}))


if __name__ == "__main__":
    main()
