"""The bracket of docs/bracket.md at rest, small strain, by the weights of its mesh, for several parts of stabilisation:
python benchmarks/mesh_statics.py SIZE BETA..., the size of edges in mm; see bracket_elements.py for finite elements."""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.sparse.linalg import LinearOperator, cg

from parsolid.scene import load_scene
from parsolid.simulation.loop import Simulation

SCENE = Path(__file__).parents[1] / "runs" / "tlsph" / "bracket.toml"
FORCE, END = 18.0, 0.06


def deflection(size: float, beta: float) -> tuple[int, float]:
    """Vertices, and the mean deflection [m] of the end's face."""
    settings = [f"bodies.0.shape.mesh.size={1e-3 * size!r}", f"method.stabilisation={beta!r}"]
    system = Simulation(MPI.COMM_SELF, load_scene(SCENE, settings)).systems[0]
    X, area = (system.particles.owned_rows(name).copy() for name in ("reference_position", "area"))
    end = np.abs(X[:, 0] - END) < 1e-9
    free = np.repeat(np.abs(X[:, 0]) > 1e-9, 3)
    load = np.zeros_like(X)
    load[end, 2] = -FORCE * area[end, 0] / area[end, 0].sum()
    forces = system.meshes._linear_forces()

    def stiffness(u: np.ndarray) -> np.ndarray:
        full = np.zeros(X.size)
        full[free] = u
        return -forces(full.reshape(X.shape)).ravel()[free]

    count = int(free.sum())
    u, failed = cg(LinearOperator((count, count), stiffness), load.ravel()[free], rtol=1e-6, maxiter=20 * count)
    if failed:
        raise SystemExit("no solution")
    full = np.zeros(X.size)
    full[free] = u
    return len(X), -float(full.reshape(X.shape)[end, 2].mean())


if __name__ == "__main__":
    for part in map(float, sys.argv[2:]):
        number, found = deflection(float(sys.argv[1]), part)
        print(f"{number} vertices, beta {part:g}: the end sinks by {1e3 * found:.4f} mm", flush=True)
