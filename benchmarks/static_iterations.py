"""Products with the tangent, time and memory of one equilibrium of a column 1 x 1 x 2, clamped and loaded across.

mpirun -n 2 python benchmarks/static_iterations.py cells,fourth-order,mesh 9,17,32 [petsc]

Numbers are nodes along the short sides; 9, 17, 32, 54, 79 have 1.4e3, 9.5e3, 6.5e4, 3.1e5, 9.8e5 nodes. "mesh" is of
tetrahedra with nodes moved at random by a fifth of their distance. "most" is of one solution to 1e-4 or closer.
"""

import resource
import sys
import tempfile
import time
from itertools import permutations
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation


def write_tetrahedra(file: Path, n: int) -> None:
    """A mesh of the column."""
    shape = (n, n, 2 * n - 1)
    number = np.indices(shape)
    points = np.stack([one.ravel() for one in number], axis=1).astype(float)
    inside = ((points > 0) & (points < np.array(shape) - 1)).all(axis=1)
    points[inside] += np.random.default_rng(1).uniform(-0.2, 0.2, (int(inside.sum()), 3))
    nodes = np.arange(np.prod(shape)).reshape(shape)
    corner = {
        bits: nodes[tuple(slice(b, n_k - 1 + b) for b, n_k in zip(bits, shape))].ravel() for bits in np.ndindex(2, 2, 2)
    }
    cells = []
    for axes in permutations(range(3)):
        path = [[int(k in axes[:i]) for k in range(3)] for i in range(4)]
        cells.append(np.stack([corner[tuple(bits)] for bits in path], axis=1))
    meshio.Mesh(points / (n - 1), [("tetra", np.concatenate(cells))]).write(file)


def column(kind: str, n: int, solver: str, folder: Path) -> dict[str, Any]:
    """Raw tables."""
    law = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    method = {"kind": "tlsph", "integrator": "static", "linear_solver": solver, "weights": kind}
    body: dict[str, Any] = {"shape": {"box": {"lower": [0.0] * 3, "upper": [1.0, 1.0, 2.0]}}, "material": law}
    if kind == "mesh":
        body["shape"] = {"mesh": {"file": str(folder / f"column{n}.vtu")}}
    else:
        body["particles"] = [n, n, 2 * n - 1]
    load = {"plane": "Z = 2", "kind": "traction", "traction": ["1e-3", "0", "0"]}
    held = {"plane": "Z = 0", "kind": "fixed"}
    return {"dimension": 3, "end_time": 1.0, "method": method, "bodies": [body], "boundaries": [held, load]}


def main() -> None:
    """A row for each kind of weights and number of nodes."""
    comm, solver = MPI.COMM_WORLD, (sys.argv[3] if len(sys.argv) > 3 else "embedded")
    folder = Path(comm.bcast(tempfile.mkdtemp() if comm.rank == 0 else None))
    if comm.rank == 0:
        print(
            "| weights | solver | ranks | nodes | corrections | products | most | set-up s | s | CPU s | MiB a rank |"
        )
        print("|---|---|---|---|---|---|---|---|---|---|---|")
    for kind in sys.argv[1].split(","):
        for n in map(int, sys.argv[2].split(",")):
            if kind == "mesh" and comm.rank == 0:
                write_tetrahedra(folder / f"column{n}.vtu", n)
            comm.Barrier()
            began = time.perf_counter()
            simulation = Simulation(comm, parse_scene(column(kind, n, solver, folder)))
            statics: Any = simulation.systems[0].statics  # type: ignore[attr-defined]
            ready, spent = time.perf_counter(), time.process_time()
            simulation.take_step(0.0)
            ended, used = time.perf_counter(), comm.allreduce(time.process_time() - spent)
            memory = comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024, MPI.MAX)
            if comm.rank == 0:
                parts = [kind, solver, comm.size, n * n * (2 * n - 1), statics.corrections, statics.products]
                parts += [statics.most_products, f"{ready - began:.1f}", f"{ended - ready:.1f}", f"{used:.1f}", memory]
                print("|", " | ".join(map(str, parts)), "|", flush=True)
            del simulation, statics


if __name__ == "__main__":
    main()
