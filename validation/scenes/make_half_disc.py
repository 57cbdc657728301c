"""Write half_disc_N.msh: half of a disc of radius 1 about the origin in quads, the sphere of an axisymmetric scene.

Its first nodes stand half a quad off the axis, where a ring has no volume. flat_half_disc_N.msh has nodes on it.

python validation/scenes/make_half_disc.py 10 20 flat-8 flat-16 flat-24
"""

import sys
from pathlib import Path

import meshio
import numpy as np


def half_disc(n: int, first: float) -> meshio.Mesh:
    """The mesh: the square [-1, 1] x [first, 1] mapped to the half disc, 2n x n quads."""
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, 2 * n + 1), np.linspace(first, 1.0, n + 1), indexing="ij")
    y, x = u * np.sqrt(1.0 - 0.5 * v**2), v * np.sqrt(1.0 - 0.5 * u**2)
    places = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    node = np.arange(len(places)).reshape(2 * n + 1, n + 1)
    cells = np.stack([node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]], axis=-1).reshape(-1, 4)
    tags = [np.ones(len(cells), int)]
    return meshio.Mesh(places, [("quad", cells)], cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags})


if __name__ == "__main__":
    for word in sys.argv[1:]:
        kind, _, number = word.rpartition("-")
        path = Path(__file__).with_name(f"{'flat_' if kind else ''}half_disc_{number}.msh")
        meshio.write(
            path, half_disc(int(number), 0.0 if kind else 0.5 / int(number)), file_format="gmsh22", binary=False
        )
