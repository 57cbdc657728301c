"""Meshes with named groups, written as Gmsh files."""

import meshio
import numpy as np
from scipy.spatial import Delaunay


def write(path, points, cells, kind, facets: dict[str, list]) -> str:
    """A plane mesh with groups of edges by name."""
    edges = [edge for group in facets.values() for edge in group]
    tags = np.repeat(np.arange(2, 2 + len(facets)), [len(group) for group in facets.values()])
    mesh = meshio.Mesh(np.column_stack([points, np.zeros(len(points))]), [(kind, cells), ("line", edges)])
    numbers = [np.full(len(cells), 1), tags]
    mesh.cell_data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
    mesh.field_data = {"body": np.array([1, 2])} | {name: np.array([i, 1]) for i, name in enumerate(facets, 2)}
    meshio.write(path, mesh, file_format="gmsh22", binary=False)
    return str(path)


def ring(path, inner: float, outer: float, layers: int) -> str:
    """A ring of about square elements, with the groups "bore" and "outside"."""
    around = round(np.pi * (inner + outer) * layers / (outer - inner))
    radius, angle = np.linspace(inner, outer, layers + 1), 2.0 * np.pi * np.arange(around) / around
    points = np.array([[r * np.cos(a), r * np.sin(a)] for r in radius for a in angle])
    node = lambda i, j: i * around + j % around  # noqa: E731
    cells = [
        [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)] for i in range(layers) for j in range(around)
    ]
    edges = {
        name: [[node(i, j), node(i, j + 1)] for j in range(around)] for name, i in (("bore", 0), ("outside", layers))
    }
    return write(path, points, cells, "quad", edges)


def block(path, turned: float, count: int = 6) -> str:
    """An uneven rectangle of triangles, 1 by 0.7, turned by an angle, with the groups "bottom", "side" and "top"."""
    x, y = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 0.7, count + 1), indexing="ij")
    inside = (x > 0) & (x < 1) & (y > 0) & (y < 0.7)
    x, y = x + 0.03 * inside * np.sin(9 * y + 5 * x), y + 0.02 * inside * np.cos(7 * x)
    c, s = np.cos(turned), np.sin(turned)
    points = np.column_stack([c * x.ravel() - s * y.ravel(), s * x.ravel() + c * y.ravel()])
    node = lambda i, j: i * (count + 1) + j  # noqa: E731
    cells = []
    for i in range(count):
        for j in range(count):
            a, b, d, e = node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)
            cells += [[a, b, d], [a, d, e]]
    edges = {
        "bottom": [[node(i, 0), node(i + 1, 0)] for i in range(count)],
        "side": [[node(0, j), node(0, j + 1)] for j in range(count)],
        "top": [[node(i, count), node(i + 1, count)] for i in range(count)],
    }
    return write(path, points, cells, "triangle", edges)


def uneven_ring(path, spacing: float, nearest: float, seed: int = 0) -> str:
    """Delaunay triangles of random points in a ring from 0.5 to 1, no two nearer than a share of a spacing."""
    random, points = np.random.default_rng(seed), []
    for radius in (0.5, 1.0):
        angle = 2.0 * np.pi * np.arange(round(2.0 * np.pi * radius / spacing)) / round(2.0 * np.pi * radius / spacing)
        points += list(radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    edge = len(points)
    while len(points) < 2.4 / spacing**2:
        place = random.uniform(-1.0, 1.0, 2)
        margin = nearest * spacing
        apart = np.linalg.norm(np.array(points) - place, axis=1).min()
        if 0.5 + margin < np.linalg.norm(place) < 1.0 - margin and apart > margin:
            points.append(place)
    places = np.array(points)
    cells = Delaunay(places).simplices
    a, b, c = (places[cells[:, i]] for i in range(3))
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    across = (cells < edge).all(axis=1) & (np.linalg.norm((a + b + c) / 3.0, axis=1) < 0.5)
    kept = cells[(area > 1e-6 * spacing**2) & ~across]
    return write(path, places, kept, "triangle", {"rim": [[edge - 1, edge - 2]]})
