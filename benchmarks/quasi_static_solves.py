"""Iterations, processor time and memory of quasi-static solves of a block on rollers, from rest, to 1e-8.

python benchmarks/quasi_static_solves.py 316x316 0.3 0.49 0.4999
mpirun -n 2 python benchmarks/quasi_static_solves.py 46x46x46 0.3
python benchmarks/quasi_static_solves.py 141x141 0.4999 --factorise 20000  # pressures factorised, 0 for none
"""

import argparse
import resource
import time
from typing import Any

from mpi4py import MPI

from parsolid.methods.peridynamics import preconditioner
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation


def block(particles: list[int], ratio: float) -> dict[str, Any]:
    """Raw tables of a unit block that a traction bends and stretches."""
    d = len(particles)
    solution = {"kind": "quasi-static", "step": 1.0}
    method = {"kind": "peridynamics", "solution": solution} | ({"plane": "strain"} if d == 2 else {})
    material = {"kind": "linear-elastic", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": ratio}
    box = {"lower": [0.0] * d, "upper": [1.0] * d}
    body = {"shape": {"box": box}, "particles": particles, "placement": "cells", "material": material}
    rollers = [{"kind": "roller", "plane": f"{axis} = 0"} for axis in "XYZ"[:d]]
    load = {"kind": "traction", "plane": "X = 1", "traction": ["0.01*Y", "0.003", "0"][:d]}
    tables = {"dimension": d, "end_time": 1.0, "method": method, "bodies": [body]}
    return tables | {"boundaries": [*rollers, load]}


def main() -> None:
    """Two steps each: the load's jump from rest, and one after it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("particles", help="such as 46x46x46")
    parser.add_argument("ratios", nargs="+", type=float, help="Poisson's ratios")
    parser.add_argument("--factorise", type=int, help="particles whose pressures are factorised at most")
    options = parser.parse_args()
    if options.factorise is not None:
        preconditioner._MOST_FACTORISED.update(dict.fromkeys((2, 3), options.factorise))
    comm = MPI.COMM_WORLD
    for ratio in options.ratios:
        simulation = Simulation(comm, parse_scene(block([int(one) for one in options.particles.split("x")], ratio)))
        solver: Any = simulation.systems[0].solver  # type: ignore[attr-defined]
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for step in (0.0, 1.0):
            before, began = solver.equilibrium.iterations, time.process_time()
            simulation.take_step(step)
            spent = comm.gather(time.process_time() - began)
            more = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory) / 1024
            if comm.rank == 0:
                each = ", ".join(f"{one:.2f}" for one in spent or ())
                count = solver.equilibrium.iterations - before
                print(
                    f"{options.particles} nu {ratio:g}: {count} iterations, {each} CPU s, {more:.0f} MiB more",
                    flush=True,
                )


if __name__ == "__main__":
    main()
