"""Meshes of one kind of elements, and of all kinds in one body, on the unit cells of a lattice with moved nodes."""

import itertools

import numpy as np

_RING = [(0, 0), (1, 0), (1, 1), (0, 1)]
_CUBE = [(*xy, z) for z in (0, 1) for xy in _RING]
# faces of a hexahedron
_FACES = ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
KINDS = {2: ("triangle", "quad", "mixed"), 3: ("tetra", "hexahedron", "wedge", "pyramid", "mixed")}


def cells_of(counts):
    """Nodes (n, d) of a lattice of unit cells and their numbers (cells, 2^d), in VTK's order; cells by their index."""
    d, shape = len(counts), [count + 1 for count in counts]
    points = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), axis=-1).reshape(-1, d).astype(float)
    number = np.arange(len(points)).reshape(shape)
    cells = {}
    for index in itertools.product(*[range(count) for count in counts]):
        corners = _RING if d == 2 else _CUBE
        cells[index] = [int(number[tuple(i + c for i, c in zip(index, corner))]) for corner in corners]
    return points, cells


def moved(points, counts, size, seed=1):
    """Nodes moved at random, but those on the surface along it alone, and not at edges and corners."""
    free = (points > 1e-9) & (points < np.array(counts) - 1e-9)
    return points + size * (np.random.default_rng(seed).random(points.shape) - 0.5) * free


def element_mesh(kind, counts, moving=0.3, scale=1.0):
    """(points (n, d), blocks (kind, (elements, nodes))): one kind, or all in one body ("mixed").

    Triangles halve quads; wedges halve hexahedra across the first two axes. Pyramids stand on the faces of a cell about
    its middle, tetrahedra on triangles that halve its faces. In a mixed body slices along the first axis take turns;
    faces between pyramids and tetrahedra are halved.
    """
    points, cells = cells_of(counts)
    points = [*moved(points, counts, moving)]
    blocks = {}

    def add(name, nodes):
        blocks.setdefault(name, []).append(nodes)

    turns = {2: ("triangle", "quad"), 3: ("wedge", "hexahedron", "pyramid", "tetra", "pyramid")}[len(counts)]

    def kind_of(index):
        return turns[index[0] % len(turns)] if kind == "mixed" else kind

    for index, nodes in cells.items():
        own = kind_of(index)
        if own in ("quad", "hexahedron"):
            add(own, nodes)
        elif own == "triangle":
            add(own, [nodes[0], nodes[1], nodes[2]])
            add(own, [nodes[0], nodes[2], nodes[3]])
        elif own == "wedge":
            add(own, [nodes[i] for i in (0, 1, 2, 4, 5, 6)])
            add(own, [nodes[i] for i in (0, 2, 3, 4, 6, 7)])
        else:
            middle = len(points)
            points.append(np.mean([points[node] for node in nodes], axis=0))
            for face in _FACES:
                corners = [nodes[i] for i in face]
                across = [other for other, its in cells.items() if set(corners) <= set(its) and other != index]
                if own == "pyramid" and not (across and kind_of(across[0]) == "tetra"):
                    add("pyramid", [*corners, middle])
                    continue
                first = int(np.argmin(corners))
                a, b, c, e = corners[first:] + corners[:first]
                add("tetra", [a, b, c, middle])
                add("tetra", [a, c, e, middle])
    return scale * np.array(points), [(name, np.array(some)) for name, some in blocks.items()]
