"""Two versions of the code in turn on one machine: processor time of a particle-step, and their ratio.

    python docs/side_by_side.py OLD_TREE NEW_TREE [--particles 27000] [--steps 3] [--turns 40] [CASE ...]

A tree is a folder with `parsolid/` and `decomposition/` in it, as `git worktree add` makes one. Each version is a
process of its own that waits while the other one steps, so that both meet the same noise of the machine; the least
of all turns and the median of the turns' ratios are told, and that times the ratio of the largest stable steps: what
the same time of motion costs. Bodies are cubes and squares in shear, or the twisting column, without output. A case may
have another method for the new version, where the old one does not know what is compared.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time

_RUBBER = {"kind": "mooney-rivlin", "density": 1100, "youngs_modulus": 17e6, "poissons_ratio": 0.45}
_BRANCH = {"branches": [{"beta": 1.0, "tau": 0.02}]}
_CASES = {
    "tlsph": ({"kind": "tlsph"}, {**_RUBBER, **_BRANCH}),
    "tlsph, leapfrog after stages": ({"kind": "tlsph"}, {**_RUBBER, **_BRANCH}, {"integrator": "leapfrog"}),
    "tlsph, h/dx 1.2, leapfrog after stages": (
        {"kind": "tlsph", "smoothing": 1.2},
        _RUBBER,
        {"integrator": "leapfrog"},
    ),
    "column, leapfrog after stages": ({"kind": "tlsph"}, {**_RUBBER, **_BRANCH}, {"integrator": "leapfrog"}),
    "tlsph, leapfrog": ({"kind": "tlsph", "integrator": "leapfrog"}, {**_RUBBER, **_BRANCH}),
    "tlsph, h/dx 1.2, leapfrog": ({"kind": "tlsph", "smoothing": 1.2, "integrator": "leapfrog"}, _RUBBER),
    "plane, leapfrog": ({"kind": "tlsph", "integrator": "leapfrog"}, {**_RUBBER, **_BRANCH}),
    "plane, h/dx 1.2, leapfrog": ({"kind": "tlsph", "smoothing": 1.2, "integrator": "leapfrog"}, _RUBBER),
    "plane, leapfrog, fourth-order": (
        {"kind": "tlsph", "integrator": "leapfrog", "weights": "fourth-order"},
        _RUBBER,
    ),
    "tlsph, h/dx 1.2": ({"kind": "tlsph", "smoothing": 1.2}, _RUBBER),
    "tlsph, leapfrog, fourth-order": ({"kind": "tlsph", "integrator": "leapfrog", "weights": "fourth-order"}, _RUBBER),
    "peridynamics": (
        {"kind": "peridynamics", "horizon_ratio": 3.0},
        {"kind": "linear-elastic", "density": 1100, "youngs_modulus": 17e6, "poissons_ratio": 0.3},
    ),
    "mpm, MUSL": (
        {"kind": "mpm", "order": "musl"},
        {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"},
    ),
    "mpm, USL": ({"kind": "mpm", "order": "usl"}, {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}),
}


# what differs from a cube in runs/tlsph/column.toml
_COLUMN = {
    "shape": {"box": {"lower": [-0.5, 0, -0.5], "upper": [0.5, 6, 0.5]}},
    "velocity": ["105*sin(pi*Y/12)*Z", "0", "-105*sin(pi*Y/12)*X"],
}


def _scene(case: str, across: int, new: bool) -> dict:
    method, material, *changed = _CASES[case]
    if changed and new:
        method = {**method, **changed[0]}
    body = {
        "shape": {"box": {"lower": [0, 0, 0], "upper": [1, 1, 1]}},
        "particles": [across] * 3,
        "velocity": ["1e-3*Y", "0", "0"],
        "material": material,
    }
    if method["kind"] == "mpm":
        method, body = {**method, "cell": 2.0 / across}, {**body, "placement": "cells"}
    scene = {"title": case, "dimension": 3, "end_time": 1.0, "method": method, "bodies": [body]}
    if case.startswith("plane"):
        body.update(shape={"box": {"lower": [0, 0], "upper": [1, 1]}}, particles=[across] * 2, velocity=["1e-3*Y", "0"])
        scene["dimension"] = 2
    if case.startswith("column"):
        body.update(_COLUMN, particles=[across, 6 * across - 5, across])
        scene["boundaries"] = [{"plane": "Y = 0", "kind": "fixed"}]
    return scene


def _work(tree: str, scene: dict) -> None:
    """Prints the largest stable step; then steps as many times as each line of the input says, and prints processor
    seconds."""
    sys.path.insert(0, tree)
    from mpi4py import MPI

    from parsolid.scene import parse_scene

    try:
        from parsolid.simulation.loop import Simulation
    except ImportError:  # the versions in which it was one module
        from parsolid.simulation import Simulation
    simulation = Simulation(MPI.COMM_SELF, parse_scene(scene))
    print(simulation.systems[0].stable_step(), flush=True)
    for line in sys.stdin:
        began = time.process_time()
        for _ in range(int(line)):
            simulation.take_step(1e-8)
        print(time.process_time() - began, flush=True)


class _Version:
    def __init__(self, tree: str, scene: dict) -> None:
        command = [sys.executable, __file__, tree, tree, "--work", json.dumps(scene)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.largest = float(self.process.stdout.readline())

    def step(self, steps: int) -> float:
        self.process.stdin.write(f"{steps}\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def end(self) -> None:
        self.process.stdin.close()
        self.process.wait()


def _compare(trees: list[str], case: str, particles: int, steps: int, turns: int) -> None:
    slender, flat = 6 if case.startswith("column") else 1, case.startswith("plane")
    across = round(particles**0.5 if flat else (particles / slender) ** (1 / 3))
    number = across**2 * (1 if flat else slender * (across - 1) + 1)
    versions = [_Version(tree, _scene(case, across, k == 1)) for k, tree in enumerate(trees)]
    # the first steps load or compile the kernels
    for version in versions:
        version.step(2)
    spent = [[version.step(steps) for version in versions] for _ in range(turns)]
    for version in versions:
        version.end()
    scale = 1e9 / (steps * number)
    old, new = (scale * min(column) for column in zip(*spent))
    ratio = statistics.median(after / before for before, after in spent)
    moved = ratio * versions[0].largest / versions[1].largest
    print(f"| {case} | {number} | {old:.0f} | {new:.0f} | {new / old:.3f} | {ratio:.3f} | {moved:.3f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(map(repr, _CASES))}; all unless given")
    for name, usual in (("--particles", 27000), ("--steps", 3), ("--turns", 40)):
        parser.add_argument(name, type=int, default=usual)
    parser.add_argument("--work", type=json.loads, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        _work(given.old, given.work)
        return
    print("| case | particles | ns a particle-step, old | new | new / old, least | median of turns | of equal motion |")
    print("|---|---|---|---|---|---|---|")
    for case in given.cases or _CASES:
        _compare([given.old, given.new], case, given.particles, given.steps, given.turns)


if __name__ == "__main__":
    main()
