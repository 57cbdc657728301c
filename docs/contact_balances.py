"""Balances of the scenes of runs/ with contact, ties or tools: python docs/contact_balances.py [words of a name]
[until=.5].

Each runs to its end, or to a share of it; told are the largest imbalance, that at the end, and the most that the
scheme has given (numerical dissipation below none) over the largest energy.
"""

import sys
from pathlib import Path
from typing import Any

from contact_tables import Rows
from mpi4py import MPI

from parsolid.scene import load_scene
from parsolid.simulation.loop import RunFailed, Simulation

RUNS = Path(__file__).parent.parent / "runs"
ROOMS = ("contact", "mixed", "tools", "ulsph", "mpm")


def scenes() -> list[Path]:
    """Those in which bodies meet, are tied, or are touched by tools."""
    found = [path for room in ROOMS for path in sorted((RUNS / room).glob("*.toml"))]
    return [path for path in found if any(f"[[{table}]]" in path.read_text() for table in ("contact", "tie", "tools"))]


def balance(path: Path, until: float) -> str:
    """What a run says."""
    end = load_scene(path).end_time * until
    overrides: Any = [f"end_time={end!r}"] if until != 1.0 else []
    simulation, rows = Simulation(MPI.COMM_SELF, load_scene(path, overrides)), Rows()
    try:
        simulation.run(None, [rows])
    except RunFailed as failure:
        return str(failure).splitlines()[0]
    columns = rows.columns()
    largest = simulation.energy_check.largest
    worst, last = abs(columns["energy_error"]).max() / largest, abs(columns["energy_error"][-1]) / largest
    given = simulation.energy_check.gained / largest
    return f"{simulation.clock.step} steps, largest {worst:.1e}, at the end {last:.1e}, given by the scheme {given:.1e}"


def main() -> None:
    """A line for each scene."""
    words = [word for word in sys.argv[1:] if "=" not in word]
    until = next((float(word.split("=")[1]) for word in sys.argv[1:] if word.startswith("until=")), 1.0)
    for path in scenes():
        name = f"{path.parent.name}/{path.stem}"
        if not words or any(word in name for word in words):
            print(f"{name}, to {until:g} of its end: {balance(path, until)}", flush=True)


if __name__ == "__main__":
    main()
