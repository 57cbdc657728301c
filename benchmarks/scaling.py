"""python benchmarks/scaling.py [CASE ...]: how efficient is a step on several ranks?

Runs a scene of every method on one rank, as N independent copies at the same time, which share the machine's memory as
ranks do, and on N ranks, in alternation. Prints nanoseconds of wall time a particle and step, times the ranks, without
the first step, and two efficiencies: N ranks beside N copies, and N ranks beside one rank that has the machine alone.

    --particles    of a scene, about
    --ranks        N, one or several; at most the cores that are free
    --repeats      of each run; medians are printed
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

HYPERELASTIC = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
METAL = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}

# case: method, material, particles beside those of the scene, steps
CASES: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any], int]] = {
    "tlsph": ({"kind": "tlsph"}, HYPERELASTIC, {}, 60),
    "tlsph_list": ({"kind": "tlsph", "weights": "closure"}, HYPERELASTIC, {"jitter": 0.1, "seed": 1}, 40),
    "peridynamics": ({"kind": "peridynamics"}, HYPERELASTIC, {}, 20),
    "peridynamics_list": ({"kind": "peridynamics"}, HYPERELASTIC, {"jitter": 0.1, "seed": 1}, 15),
    "mpm": ({"kind": "mpm"}, METAL, {}, 20),
    "ulsph": ({"kind": "ulsph"}, METAL, {}, 8),
}


def scene_of(name: str, particles: int) -> dict[str, Any]:
    """A cube of so many particles that turns slowly."""
    method, material, more, _ = CASES[name]
    side = round(particles ** (1 / 3))
    body = {"shape": {"box": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]}}, "material": material, **more}
    body |= {"particles": [side] * 3, "velocity": ["-.1*Y", ".1*X", "-.2*Z"]}
    if name.startswith(("peridynamics", "mpm", "ulsph")):
        body["placement"] = "cells"
    method = method | ({"cell": 2.0 / side} if method["kind"] == "mpm" else {})
    output = {"history_steps": 100000, "fields_times": [], "pictures": False}
    return {"title": name, "dimension": 3, "end_time": 10.0, "method": method, "bodies": [body], "output": output}


def run(scene: Path, steps: int, ranks: int, copies: int) -> list[dict[str, Any]]:
    """Summaries of so many runs at the same time, each on so many ranks."""
    with tempfile.TemporaryDirectory() as folder:
        outs = [Path(folder) / str(copy) for copy in range(copies)]
        launch = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        words = [*launch, sys.executable, "-m", "parsolid", "run", str(scene), "-q", "--max-steps", str(steps)]
        started = [subprocess.Popen([*words, "-o", str(out)], stdout=subprocess.DEVNULL) for out in outs]
        statuses = [one.wait() for one in started]
        if any(statuses):
            raise SystemExit(f"{scene}: a run failed")
        return [json.loads((out / "summary.json").read_text()) for out in outs]


def nanoseconds(summaries: Sequence[dict[str, Any]]) -> float:
    """Wall time a particle and step times the ranks, without the first step: mean of the runs."""
    spent = [one["loop_seconds"] - one["first_step_seconds"] for one in summaries]
    each = [1e9 * s * one["ranks"] / one["particles"] / (one["steps"] - 1) for s, one in zip(spent, summaries)]
    return float(np.mean(each))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(CASES)}")
    parser.add_argument("--particles", type=int, default=216_000)
    parser.add_argument("--ranks", type=int, nargs="+", default=[2])
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    print(
        f"{'case':20s}{'ranks':>6s}{'alone ns':>10s}{'copies ns':>10s}{'ranks ns':>10s}{'of copies':>11s}{'of one':>8s}"
    )
    for name in options.cases or CASES:
        with tempfile.TemporaryDirectory() as folder:
            scene = Path(folder) / f"{name}.toml"
            scene.write_text(tomli_w.dumps(scene_of(name, options.particles)))
            steps = CASES[name][3]
            run(scene, 2, 1, 1)  # compiles what is missing
            for ranks in options.ranks:
                kinds = ((1, 1), (1, ranks), (ranks, 1))
                found = [[nanoseconds(run(scene, steps, *kind)) for kind in kinds] for _ in range(options.repeats)]
                alone, copies, together = np.median(found, axis=0)
                numbers = f"{alone:10.0f}{copies:10.0f}{together:10.0f}{copies / together:11.2f}{alone / together:8.2f}"
                print(f"{name:20s}{ranks:6d}{numbers}", flush=True)


if __name__ == "__main__":
    main()
