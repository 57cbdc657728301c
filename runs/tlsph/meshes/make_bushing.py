"""Write bushing.msh: a rubber ring of about square elements with the groups "bore" and "outside", as Gmsh does.

    python runs/tlsph/meshes/make_bushing.py [LAYERS]

The radii are 10 and 20 mm, LAYERS (6) is the number of elements between them.
"""

import sys
from pathlib import Path

import meshio
import numpy as np

INNER, OUTER = 0.01, 0.02


def bushing(layers: int) -> meshio.Mesh:
    """The mesh, with its physical groups."""
    around = round(np.pi * (INNER + OUTER) * layers / (OUTER - INNER))
    radius, angle = np.linspace(INNER, OUTER, layers + 1), 2.0 * np.pi * np.arange(around) / around
    places = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], axis=-1).reshape(-1, 2)
    node = np.arange(len(places)).reshape(layers + 1, around)
    after = np.roll(node, -1, axis=1)
    cells = np.stack([node[:-1], node[1:], after[1:], after[:-1]], axis=-1).reshape(-1, 4)
    edges = np.concatenate([np.stack([node[row], after[row]], axis=1) for row in (0, layers)])
    tags = [np.full(len(cells), 1), np.repeat([2, 3], around)]
    return meshio.Mesh(
        np.column_stack([places, np.zeros(len(places))]),
        [("quad", cells), ("line", edges)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"rubber": np.array([1, 2]), "bore": np.array([2, 1]), "outside": np.array([3, 1])},
    )


if __name__ == "__main__":
    mesh = bushing(int(sys.argv[1]) if len(sys.argv) > 1 else 6)
    meshio.write(Path(__file__).with_name("bushing.msh"), mesh, file_format="gmsh22", binary=False)
