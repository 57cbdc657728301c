"""Write concrete_beam_N.msh: a beam of 175 x 50 mm in quads, N of them over its depth, in the middle a notch of half
the depth and the width of an element; lengths in m, the origin below the middle.

python validation/scenes/make_concrete_beam.py 10 20
"""

import sys
from pathlib import Path

import meshio
import numpy as np


def notched_beam(over_depth: int) -> meshio.Mesh:
    """The mesh; an odd number of elements along the beam, so that the notch is in the middle."""
    size = 0.05 / over_depth
    along = 2 * round((3.5 * over_depth - 1) / 2) + 1
    x, y = np.meshgrid(size * (np.arange(along + 1) - along / 2), size * np.arange(over_depth + 1), indexing="ij")
    node = np.arange(x.size).reshape(x.shape)
    cells = np.stack([node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]], axis=-1)
    solid = np.full((along, over_depth), True)
    solid[along // 2, : over_depth // 2] = False
    used, cells = np.unique(cells[solid], return_inverse=True)
    places = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)[used]
    tags = np.ones(solid.sum(), int)
    return meshio.Mesh(
        places, [("quad", cells.reshape(-1, 4))], cell_data={"gmsh:physical": [tags], "gmsh:geometrical": [tags]}
    )


if __name__ == "__main__":
    for word in sys.argv[1:]:
        path = Path(__file__).with_name(f"concrete_beam_{word}.msh")
        meshio.write(path, notched_beam(int(word)), file_format="gmsh22", binary=False)
