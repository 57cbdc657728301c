"""python docs/mesh_setup.py [NODES_A_SIDE]: what a mesh of a cube costs until the first step, on 1, 2 and 4 ranks.

Makes the table of docs/parts.md: processor seconds and peak memory of the rank that reads, and of the others at most.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import meshio
import numpy as np
from mpi4py import MPI

from parsolid.output.summary import peak_memory_bytes
from parsolid.particles.mesh_pieces import MeshPieces
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

# tetrahedra of a hexahedron, by its corners in VTK's order
SIX = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
RING = ((0, 0), (1, 0), (1, 1), (0, 1))


def write_cube(path: Path, side: int) -> None:
    """A cube of so many nodes a side, as Gmsh writes it in binary."""
    line = np.linspace(0.0, 1.0, side)
    points = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(side**3).reshape(side, side, side)
    corners = [number[x : side - 1 + x, y : side - 1 + y, z : side - 1 + z].ravel() for z in (0, 1) for x, y in RING]
    cells = np.concatenate([np.stack([corners[k] for k in four], axis=1) for four in SIX])
    ones = [np.ones(len(cells), int)]
    mesh = meshio.Mesh(points, [("tetra", cells)], cell_data={"gmsh:physical": ones, "gmsh:geometrical": ones})
    meshio.write(path, mesh, file_format="gmsh", binary=True)


def set_up(path: str) -> None:
    """On all ranks: from the scene to the first step; prints a row of the table."""
    comm, spent = MPI.COMM_WORLD, [0.0]
    make = MeshPieces.__init__

    def timed(*arguments: object) -> None:
        began = time.process_time()
        make(*arguments)  # type: ignore[arg-type]
        spent[0] += time.process_time() - began

    MeshPieces.__init__ = timed  # type: ignore[assignment,method-assign]
    law = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
    body = {"shape": {"mesh": {"file": path}}, "material": law}
    fixed = [{"kind": "fixed", "plane": "Z = 0"}]
    tables = {"dimension": 3, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body], "boundaries": fixed}
    began = time.process_time()
    simulation = Simulation(comm, parse_scene(tables))
    simulation.stable_step()
    mine = (time.process_time() - began, spent[0], peak_memory_bytes() / 2**20)
    rows = np.array(comm.gather(mine) or [mine])
    if comm.rank == 0:
        others = rows[1:].max(axis=0, initial=0.0)
        print(
            f"| {comm.size} | {rows[0, 0]:.1f} | {rows[0, 1]:.1f} | {others[0]:.1f} | {rows[0, 2]:.0f} | "
            f"{others[2]:.0f} |",
            flush=True,
        )


def main() -> None:
    """The table."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cube.msh"
        write_cube(path, int(sys.argv[1]) if len(sys.argv) > 1 else 61)
        print("| ranks | reader: s | of it the mesh | each other rank: s | reader: MiB | others: MiB |")
        print("|---|---|---|---|---|---|", flush=True)
        mpirun = str(Path(sys.executable).with_name("mpirun"))
        for ranks in (1, 2, 4):
            launch = [mpirun, "-n", str(ranks)] if ranks > 1 else []
            subprocess.run([*launch, sys.executable, __file__, "--read", str(path)], check=True, timeout=500)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--read"]:
        set_up(sys.argv[2])
    else:
        main()
