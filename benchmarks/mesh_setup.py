"""python benchmarks/mesh_setup.py [NODES_A_SIDE]: what a mesh costs until the first step, on 1, 2 and 4 ranks.

Makes the table of docs/parts.md, of a binary Gmsh file and of what `parsolid import` makes of it: processor seconds
from the scene to the particles or the first step, and peak memory, of the first rank and of the others at most. A rank
that waits for a message takes its processor.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

from parsolid.output.summary import peak_memory_bytes
from parsolid.particles.generation import generate
from parsolid.particles.meshes.imported import import_mesh
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

# tetrahedra of a hexahedron, by its corners in VTK's order
SIX = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
RING = ((0, 0), (1, 0), (1, 1), (0, 1))


def write_cube(path: Path, side: int) -> None:
    """A cube of so many nodes a side, as Gmsh writes it in binary."""
    import meshio

    line = np.linspace(0.0, 1.0, side)
    points = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(side**3).reshape(side, side, side)
    corners = [number[x : side - 1 + x, y : side - 1 + y, z : side - 1 + z].ravel() for z in (0, 1) for x, y in RING]
    cells = np.concatenate([np.stack([corners[k] for k in four], axis=1) for four in SIX])
    ones = [np.ones(len(cells), int)]
    mesh = meshio.Mesh(points, [("tetra", cells)], cell_data={"gmsh:physical": ones, "gmsh:geometrical": ones})
    mesh.field_data = {"body": np.array([1, 3])}
    meshio.write(path, mesh, file_format="gmsh", binary=True)


def set_up(path: str, particles_only: bool) -> None:
    """On all ranks: from the scene to the first step; prints a row of the table."""
    comm = MPI.COMM_WORLD
    law = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
    body = {"shape": {"mesh": {"file": path}}, "material": law}
    tables = {"dimension": 3, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body]}
    scene = parse_scene(tables | {"boundaries": [{"kind": "fixed", "plane": "Z = 0"}]})
    comm.Barrier()
    began = time.process_time()
    if particles_only:
        generate(scene, comm)
    else:
        Simulation(comm, scene).stable_step()
    seconds, memory = time.process_time() - began, peak_memory_bytes() / 2**20
    rows = np.array(comm.gather((seconds, memory)) or [(seconds, memory)])
    if comm.rank == 0:
        what = "particles" if particles_only else "first step"
        first, others = rows[0], rows[1:].max(axis=0, initial=0.0)
        kind = "imported" if path.endswith(".h5") else "plain"
        numbers = f"{first[0]:.1f} | {others[0]:.1f} | {first[1]:.0f} | {others[1]:.0f}"
        print(f"| {comm.size} | {kind} | {what} | {numbers} |", flush=True)


def main() -> None:
    """The table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("side", type=int, nargs="?", default=100, help="nodes a side of the cube")
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--particles-only", action="store_true", help="no lists of neighbours, no weights")
    parser.add_argument("--read", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.read:
        set_up(options.read, options.particles_only)
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cube.msh"
        write_cube(path, options.side)
        began = time.perf_counter()
        import_mesh(str(path), str(path.with_suffix(".h5")))
        print(f"imported in {time.perf_counter() - began:.1f} s\n")
        print("| ranks | file | until | first rank: s | others: s | first rank: MiB | others: MiB |")
        print("|---|---|---|---|---|---|---|", flush=True)
        mpirun = str(Path(sys.executable).with_name("mpirun"))
        for ranks in options.ranks:
            for file in (path, path.with_suffix(".h5")):
                launch = [mpirun, "-n", str(ranks)] if ranks > 1 else []
                more = ["--particles-only"] if options.particles_only else []
                read = [sys.executable, __file__, "--read", str(file), *more]
                subprocess.run([*launch, *read], check=True, timeout=900)


if __name__ == "__main__":
    main()
