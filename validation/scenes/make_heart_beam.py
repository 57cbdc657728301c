"""Write heart_beam_N.msh: the beam of Land et al. (2015), problem 1, of 10 N x N x N hexahedra; lengths in mm.

python validation/scenes/make_heart_beam.py 2 4
"""

import sys
from pathlib import Path

import meshio
import numpy as np


def beam(n: int) -> meshio.Mesh:
    """The mesh of 10 x 1 x 1."""
    places = np.stack(np.meshgrid(*(np.arange(k * n + 1.0) / n for k in (10, 1, 1)), indexing="ij"), axis=-1)
    node = np.arange(places[..., 0].size).reshape(places.shape[:3])
    ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
    cells = [node[i : i + 10 * n, j : j + n, k : k + n].ravel() for k in (0, 1) for i, j in ring]
    return meshio.Mesh(places.reshape(-1, 3), [("hexahedron", np.stack(cells, axis=1))])


if __name__ == "__main__":
    for word in sys.argv[1:]:
        path = Path(__file__).with_name(f"heart_beam_{word}.msh")
        meshio.write(path, beam(int(word)), file_format="gmsh22", binary=False)
