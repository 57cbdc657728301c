"""Write cook_N.msh: Cook's membrane of N x N quads with the groups "clamp" and "load", as Gmsh does; lengths in mm.

python validation/scenes/make_cook.py 8 16
"""

import sys
from pathlib import Path

import meshio
import numpy as np


def membrane(n: int) -> meshio.Mesh:
    """The mesh: corners (0, 0), (48, 44), (48, 60), (0, 44), with its physical groups."""
    s = np.linspace(0.0, 1.0, n + 1)
    x, share = np.meshgrid(48.0 * s, s, indexing="ij")
    low, high = 44.0 * x / 48.0, 44.0 + 16.0 * x / 48.0
    places = np.stack([x, low + share * (high - low), 0.0 * x], axis=-1).reshape(-1, 3)
    node = np.arange(len(places)).reshape(n + 1, n + 1)
    cells = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1).reshape(-1, 4)
    edges = np.concatenate([np.stack([node[i, :-1], node[i, 1:]], axis=1) for i in (0, n)])
    tags = [np.full(len(cells), 1), np.repeat([2, 3], n)]
    return meshio.Mesh(
        places,
        [("quad", cells), ("line", edges)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"membrane": np.array([1, 2]), "clamp": np.array([2, 1]), "load": np.array([3, 1])},
    )


if __name__ == "__main__":
    for word in sys.argv[1:]:
        path = Path(__file__).with_name(f"cook_{word}.msh")
        meshio.write(path, membrane(int(word)), file_format="gmsh22", binary=False)
