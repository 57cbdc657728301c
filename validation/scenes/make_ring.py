"""Write ring_N.msh: a thin ring of mean circumference 1 in quads of the length 1/N; its wall is 1/160 wide.

Nodes are moved by up to a twentieth of the length, by chance, without which it would not know where to break.

python validation/scenes/make_ring.py 320 640
"""

import sys
from pathlib import Path

import meshio
import numpy as np


def ring(n: int) -> meshio.Mesh:
    """The mesh, n x n/160 square quads about the origin."""
    through = n // 160
    angles, offsets = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False), (np.arange(through + 1) - 0.5 * through) / n
    radii = 0.5 / np.pi + offsets
    x, y = radii * np.cos(angles)[:, None], radii * np.sin(angles)[:, None]
    moved = np.random.default_rng(1).uniform(-0.05 / n, 0.05 / n, (2, *x.shape))
    x, y = x + moved[0], y + moved[1]
    places = np.stack([x, y, 0.0 * x], axis=-1).reshape(-1, 3)
    node = np.arange(len(places)).reshape(n, through + 1)
    after = np.roll(node, -1, axis=0)
    cells = np.stack([node[:, :-1], node[:, 1:], after[:, 1:], after[:, :-1]], axis=-1).reshape(-1, 4)
    tags = [np.ones(len(cells), int)]
    return meshio.Mesh(places, [("quad", cells)], cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags})


if __name__ == "__main__":
    for word in sys.argv[1:]:
        path = Path(__file__).with_name(f"ring_{word}.msh")
        meshio.write(path, ring(int(word)), file_format="gmsh22", binary=False, float_fmt=".7e")
