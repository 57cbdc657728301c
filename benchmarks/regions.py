"""python benchmarks/regions.py [--nodes N ...]: what driven regions, reactions and springs cost a step.

A cube of n^3 nodes whose ends are driven and whose side stands on springs, one condition after the other, beside the
free cube: processor time of a step, and by what share it is longer. Runs alternate, the least of each counts. With
--weights mesh the cube is a mesh of about as many nodes (needs the extra "cad").
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import parsolid
from parsolid.simulation.loop import Limits

ENDS: list[dict[str, Any]] = [
    {"kind": "velocity", "plane": "X = 0", "velocity": ["0.01*sin(5*t)", 0, 0], "name": "left"},
    {"kind": "velocity", "plane": "X = 1", "velocity": ["-0.01*sin(5*t)", "0.02*t", "free"], "name": "right"},
]
TURNED = {"kind": "rotation", "plane": "X = 1", "centre": [0.5] * 3, "axis": [1, 0, 0], "angle": "0.1*(1 - cos(t))"}
SPRING = {"kind": "spring", "plane": "Y = 0", "stiffness": 1e5, "damping": 10.0, "name": "side"}
CASES: dict[str, list[dict[str, Any]]] = {
    "free": [],
    "driven": ENDS,
    "driven, reactions": [one | {"reaction": True} for one in ENDS],
    "spring": [SPRING],
    "driven, spring, reactions": [one | {"reaction": True} for one in (*ENDS, SPRING)],
    "bent and turned, spring, reactions": [
        ENDS[0] | {"velocity": ["0.01*sin(5*t)*(1 + Y)", "0.02*t", 0], "reaction": True},
        TURNED | {"name": "right", "reaction": True},
        SPRING | {"reaction": True},
    ],
}


FOLDER = tempfile.TemporaryDirectory()


def scene(nodes: int, boundaries: list[dict[str, Any]], weights: str) -> dict[str, Any]:
    """Tables of a cube."""
    box = {"box": {"lower": [0] * 3, "upper": [1] * 3}}
    body: dict[str, Any] = {"shape": box, "particles": [nodes] * 3, "placement": "vertices"}
    if weights == "mesh":
        file = Path(FOLDER.name) / "cube.geo"
        file.write_text('SetFactory("OpenCASCADE"); Box(1) = {0,0,0,1,1,1};')
        body = {"shape": {"file": str(file), "size": 1.1 / (nodes - 1)}}
    body["material"] = {"kind": "neo-hookean", "density": 1000, "youngs_modulus": 3e6, "poissons_ratio": 0.45}
    method = {"kind": "tlsph", "weights": weights}
    output = {"history_steps": 100_000, "fields_times": [], "pictures": False}
    plain = {"dimension": 3, "end_time": 10.0, "method": method, "bodies": [body], "output": output}
    return plain | {"boundaries": boundaries}


def main() -> int:
    """Print a line a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, nargs="*", default=[10, 27], help="along an edge of the cube")
    parser.add_argument("--weights", default="best")
    parser.add_argument("--rounds", type=int, default=9)
    words = parser.parse_args()
    for nodes in words.nodes:
        runs = {name: parsolid.Simulation(scene(nodes, CASES[name], words.weights)).core for name in CASES}
        least, steps = dict.fromkeys(CASES, float("inf")), max(20, 200_000 // nodes**3)
        for turn in range(words.rounds + 1):
            for name, run in runs.items():
                began, first = time.process_time(), run.clock.step
                run.run(None, (), Limits(steps=steps))
                if turn:
                    least[name] = min(least[name], (time.process_time() - began) / (run.clock.step - first))
        count = runs["free"].systems[0].owned
        for name, seconds in least.items():
            print(f"{count:6d} nodes  {name:36s}{1e6 * seconds:9.1f} us a step {seconds / least['free'] - 1.0:+6.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
