"""python benchmarks/forecasts.py [WORD]: what `parsolid check --ranks N` says beside what runs on N ranks then take.

Makes the table of docs/cluster.md: each scene is checked on one rank, and run on 1, 2 and 4 for 200 steps, three times
in turn, since a machine that others share changes its pace within minutes. Medians, in brackets that of the turns'
ratios, of the times the spread of the three. Times are the mean of the ranks; how much more the busiest has to do
stands apart, as no check knows it.
"""

import json
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py

from parsolid.output.vtkhdf import published

SCENES = {
    "tlsph, 3-D": ("runs/tlsph/column.toml", ["bodies.0.particles=[17,97,17]"]),
    "peridynamics, 2-D": ("runs/peridynamics/plate.toml", ["bodies.0.particles=[161,161]"]),
    "ulsph, 3-D": ("runs/ulsph/taylor.toml", []),
    "mpm, 3-D": ("runs/mpm/taylor_quarter.toml", []),
}
# as many as a check takes at most, so that both are of the same motion
STEPS = 200
TURNS = 3
MIB = 2.0**20


def parsolid(ranks: int, *words: str) -> str:
    """What a command prints."""
    launch = [str(Path(sys.executable).with_name("mpirun")), "-n", str(ranks)] if ranks > 1 else []
    command = [*launch, sys.executable, "-m", "parsolid", *words]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=560).stdout


def forecast(scene: str, options: list[str], ranks: int) -> dict[str, float]:
    """Numbers of the report on so many ranks: MiB and ms."""
    said = parsolid(1, "check", scene, "--ranks", str(ranks), *options)
    find = {"memory": r"memory a rank +([\d.,e+]+) MiB   of", "work": r"of which ([\d.,e+-]+) ms of the processor"}
    find |= {"fields": r"times of ([\d.e+]+) MiB", "checkpoint": r"two of ([\d.e+]+) MiB"}
    return {name: float(re.search(words, said)[1].replace(",", "")) for name, words in find.items()}


def measured(scene: str, options: list[str], ranks: int) -> dict[str, float]:
    """The same of a run."""
    with tempfile.TemporaryDirectory() as folder:
        more = ["--set", "output.fields_times=[0]", "--set", "output.pictures=false", "--max-steps", str(STEPS)]
        parsolid(ranks, "run", scene, "-q", "-o", folder, *options, *more)
        found = json.loads((Path(folder) / "summary.json").read_text())
        # of the processor: other work on the machine does not lengthen it
        seconds = found["work_processor_seconds_by_rank"]
        fields = bytes_of_a_time(Path(folder) / "fields.vtkhdf")
        return {
            "memory": found["peak_memory_bytes_per_rank"] / MIB,
            "work": 1e3 * statistics.mean(seconds) / (found["steps"] - 1),
            "busiest": max(seconds) / statistics.mean(seconds),
            "fields": fields / MIB,
            "checkpoint": (Path(folder) / "checkpoint.h5").stat().st_size / MIB,
        }


def bytes_of_a_time(path: Path) -> float:
    """Storage of what varies, over the number of times that there is room for."""
    layout, _ = published(path)
    with h5py.File(path, "r", locking=False) as file:
        data = file["VTKHDF"]
        sets = [data["Points"], *(data[f"PointData/{name}"] for name in layout.varying)]
        return sum(one.id.get_storage_size() for one in sets) / layout.capacity


def main() -> None:
    """The table."""
    titles = ["memory a rank [MiB]", "processor a step [ms]", "fields of a time [MiB]", "checkpoint [MiB]"]
    print(f"| {' | '.join(['scene', 'ranks', *titles, 'three turns [ms]', 'busiest rank over the mean'])} |")
    print("|---" + 7 * "|---:" + "|")
    for name, (scene, changes) in SCENES.items():
        if not any(word in name for word in sys.argv[1:] or [""]):
            continue
        options = [word for change in changes for word in ("--set", change)]
        # what has to be compiled is compiled here
        parsolid(1, "check", scene, *options)
        for ranks in (1, 2, 4):
            turns = [(forecast(scene, options, ranks), measured(scene, options, ranks)) for _ in range(TURNS)]
            said, took = (
                {key: statistics.median(one[side][key] for one in turns) for key in turns[0][side]} for side in (0, 1)
            )
            # of each turn, whose two halves see the same machine
            off = {key: statistics.median(one[0][key] / one[1][key] for one in turns) - 1.0 for key in said}
            cells = [f"{said[key]:.3g} / {took[key]:.3g} ({off[key]:+.0%})" for key in said]
            spreads = [
                f"{min(of):.3g} to {max(of):.3g}" for of in ([one[side]["work"] for one in turns] for side in (0, 1))
            ]
            rest = [" / ".join(spreads), f"{took['busiest']:.2f}"]
            print(f"| {name} | {ranks} | {' | '.join([*cells, *rest])} |", flush=True)


if __name__ == "__main__":
    main()
