"""Free bodies on meshes and boxes against exact frequencies: python benchmarks/modes.py [SHAPE...] [SPACINGS...]

Shapes are ring, disc, sphere, column, block, plate; spacings a unit length, 8 16 24 unless given. Meshes are Gmsh's.
Errors are the root mean square of those of the first five frequencies, of a sphere of the first ten
(five torsional and five spheroidal ones of degree 2); a block is a box on a lattice.
"""

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from free_modes import Solid, box_frequencies, ring_frequencies, sphere_frequencies
from mpi4py import MPI

from parsolid.api.modes import find_modes
from parsolid.scene import parse_scene

SOLID = Solid(1.0, 0.3, 1.0)
MATERIAL = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
EXACT = {
    "ring": lambda: ring_frequencies(SOLID, 0.5, 1.0, 5),
    "disc": lambda: ring_frequencies(SOLID, 0.0, 1.0, 5),
    "sphere": lambda: sphere_frequencies(SOLID, 1.0, 10),
    "column": lambda: box_frequencies(SOLID, (1.0, 1.0, 2.0), 5),
    "block": lambda: box_frequencies(SOLID, (1.0, 1.0, 2.0), 5),
    "plate": lambda: box_frequencies(SOLID, (1.0, 3.0), 5),
}
# of boxes on lattices
WEIGHTS = {"block": ("cells", "fourth-order"), "plate": ("cells", "fourth-order")}


def write_mesh(shape: str, spacings: float, path: Path) -> None:
    """Triangles or tetrahedra of edges of 1/spacings."""
    import gmsh

    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Verbosity", 1)
        make = gmsh.model.occ
        if shape == "ring":
            make.cut([(2, make.addDisk(0, 0, 0, 1, 1))], [(2, make.addDisk(0, 0, 0, 0.5, 0.5))])
        elif shape == "disc":
            make.addDisk(0, 0, 0, 1, 1)
        elif shape == "sphere":
            make.addSphere(0, 0, 0, 1)
        else:
            make.addBox(0, 0, 0, 1, 1, 2)
        make.synchronize()
        for bound in ("Min", "Max"):
            gmsh.option.setNumber(f"Mesh.MeshSize{bound}", 1.0 / spacings)
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.model.mesh.generate(2 if shape in ("ring", "disc") else 3)
        if shape not in ("ring", "disc"):
            gmsh.model.mesh.optimize("Netgen")
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def tables(shape: str, spacings: float, folder: Path, weights: str) -> dict:
    """The scene of a shape."""
    body: dict = {"material": MATERIAL}
    method: dict = {"kind": "tlsph"}
    if shape in WEIGHTS:
        sides = (1.0, 1.0, 2.0) if shape == "block" else (1.0, 3.0)
        body["shape"] = {"box": {"lower": [0.0] * len(sides), "upper": list(sides)}}
        body["particles"] = [round(side * spacings) + 1 for side in sides]
        method["weights"] = weights
    else:
        file = folder / f"{shape}-{spacings:g}.msh"
        write_mesh(shape, spacings, file)
        body["shape"] = {"mesh": {"file": str(file)}}
    plane = shape in ("ring", "disc", "plate")
    return {"dimension": 2 if plane else 3, "end_time": 1.0, "method": method, "bodies": [body]}


def errors_of(
    shape: str, spacings: float, folder: Path, weights: str = "mesh", **method: float
) -> tuple[np.ndarray, Any]:
    """Relative errors of the lowest frequencies, and what was found; method: further keys of it. Collective."""
    data, exact = tables(shape, spacings, folder, weights), EXACT[shape]()
    data["method"].update(method)
    found = find_modes(MPI.COMM_WORLD, parse_scene(data), len(exact), None)
    return found.frequencies[found.rigid :] * 2.0 * np.pi / exact - 1.0, found


def main() -> None:
    """Print a row a shape and spacing, with the order between rows."""
    asked = [word for word in sys.argv[1:] if word in EXACT] or list(EXACT)
    spacings = [float(word) for word in sys.argv[1:] if word not in EXACT] or [8.0, 16.0, 24.0]
    kinds = [(shape, weights) for shape in asked for weights in WEIGHTS.get(shape, ("mesh",))]
    with tempfile.TemporaryDirectory() as folder:
        for shape, weights in kinds:
            last: tuple[float, float] | None = None
            for m in spacings:
                errors, found = errors_of(shape, m, Path(folder), weights)
                size = float(np.sqrt(np.mean(errors**2)))
                order = "-" if last is None else f"{np.log(last[1] / size) / np.log(m / last[0]):.2f}"
                last = m, size
                told = " ".join(f"{100 * one:.2g}" for one in errors)
                print(
                    f"{shape:7} {weights:12} {m:4g} {found.particles:7} {found.rigid} rigid, error {100 * size:.3g} %"
                    f" [{told}], order {order}, {found.iterations} iterations, {found.products} products,"
                    f" {found.seconds:.2f} s",
                    flush=True,
                )


if __name__ == "__main__":
    main()
