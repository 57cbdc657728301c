"""Linear finite elements: volumes lumped to their nodes, facets and edges. Node orders are VTK's, as meshio
gives them.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np


class Element(NamedTuple):
    """The topology of an element kind; facets and edges are given by local node numbers."""

    dimension: int
    facets: tuple[tuple[int, ...], ...]
    edges: tuple[tuple[int, int], ...]
    # nodes of the product element (quad or hexahedron) that it is with some in one place, None for a simplex
    product: tuple[int, ...] | None


# reference coordinates of the nodes of a quad and a hexahedron
_SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_CUBE = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
CORNERS = {2: _SQUARE, 3: _CUBE}
_RING = ((0, 1), (1, 2), (2, 3), (3, 0))

ELEMENTS = {
    "triangle": Element(2, ((0, 1), (1, 2), (2, 0)), ((0, 1), (1, 2), (2, 0)), None),
    "quad": Element(2, _RING, _RING, (0, 1, 2, 3)),
    "tetra": Element(3, ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)), tuple(itertools.combinations(range(4), 2)), None),
    "hexahedron": Element(
        3,
        ((0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
        (*_RING, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
        (0, 1, 2, 3, 4, 5, 6, 7),
    ),
    "wedge": Element(
        3,
        ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
        ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
        (0, 1, 2, 2, 3, 4, 5, 5),
    ),
    "pyramid": Element(
        3,
        ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
        (*_RING, (0, 4), (1, 4), (2, 4), (3, 4)),
        (0, 1, 2, 3, 4, 4, 4, 4),
    ),
}
# elements of second order: the elements of their corners, which come first among their nodes, and how many these are
OF_CORNERS = {
    **dict.fromkeys(("line3", "line4"), ("line", 2)),
    **dict.fromkeys(("triangle6", "triangle7"), ("triangle", 3)),
    **dict.fromkeys(("quad8", "quad9"), ("quad", 4)),
    "tetra10": ("tetra", 4),
    **dict.fromkeys(("hexahedron20", "hexahedron24", "hexahedron27"), ("hexahedron", 8)),
    **dict.fromkeys(("wedge15", "wedge18"), ("wedge", 6)),
    **dict.fromkeys(("pyramid13", "pyramid14"), ("pyramid", 5)),
}


def _at_gauss_points(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (points, nodes) and their gradients (points, nodes, d) at the 2^d Gauss points."""
    dimension = corners.shape[1]
    places = corners / math.sqrt(3.0)
    factor = 0.5 * (1.0 + places[:, None, :] * corners[None, :, :])
    gradient = np.empty((len(places), *corners.shape))
    for i in range(dimension):
        others = [k for k in range(dimension) if k != i]
        gradient[:, :, i] = 0.5 * corners[None, :, i] * factor[:, :, others].prod(axis=2)
    return factor.prod(axis=2), gradient


def lumped_volumes(kind: str, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Volume of each element lumped to its nodes, which elements are sound, and which are turned inside out.

    nodes is (elements, nodes, d) [m]; returns (elements, nodes) [m^3] and (elements,) bool twice. Elements turned
    inside out as a whole (all Jacobians negative) are counted with the opposite order of their nodes; those with
    Jacobians of both signs, or zero, are not sound. The quadrature is exact.
    """
    element = ELEMENTS[kind]
    if element.product is None:
        arms = nodes[:, 1:] - nodes[:, :1]
        volume = np.linalg.det(arms) / math.factorial(element.dimension)
        size = largest(np.abs(arms).reshape(len(arms), element.dimension**2)) ** element.dimension
        count = nodes.shape[1]
        return np.repeat(np.abs(volume)[:, None] / count, count, axis=1), np.abs(volume) > 1e-14 * size, volume < 0.0
    values, gradient = _at_gauss_points(CORNERS[element.dimension])
    jacobian = np.linalg.det(np.einsum("eni,gnj->egij", nodes[:, element.product], gradient))
    turned = (jacobian < 0.0).all(axis=1)
    of_product = np.abs(jacobian) @ values
    result = np.zeros(nodes.shape[:2])
    for column, node in enumerate(element.product):
        result[:, node] += of_product[:, column]
    return result, (jacobian > 0.0).all(axis=1) | turned, turned


def largest(rows: np.ndarray) -> np.ndarray:
    """The largest of each of many short rows (n, k), column by column, which is several times as fast as by rows."""
    result = rows[:, 0].copy()
    for column in rows.T[1:]:
        np.maximum(result, column, out=result)
    return result


def facet_areas(facets: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Area vectors (facets, d) [m^2] of facets (facets, nodes, d), pointing away from the points inner (facets, d)."""
    if facets.shape[1] == 2:
        along = facets[:, 1] - facets[:, 0]
        area = np.stack([along[:, 1], -along[:, 0]], axis=1)
    else:
        # half the cross product of the diagonals, or of two edges of a triangle
        first = facets[:, 2] - facets[:, 0]
        second = facets[:, 3] - facets[:, 1] if facets.shape[1] == 4 else facets[:, 2] - facets[:, 1]
        area = 0.5 * np.cross(first, second)
    inward = ((facets.mean(axis=1) - inner) * area).sum(axis=1) < 0.0
    return np.where(inward[:, None], -area, area)


def shares_of_nodes(facets: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Integrals (facets, nodes, d) [m^2] of the nodes' functions times the outward normal over facets (facets, nodes,
    d) [m] of area vectors (facets, d): equal parts, but of quads in space that are no parallelograms."""
    if facets.shape[1] < 4:
        return np.repeat(area[:, None] / facets.shape[1], facets.shape[1], axis=1)
    values, gradient = _at_gauss_points(_SQUARE)
    tangents = np.einsum("eni,qnk->eqki", facets, gradient)
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    result = np.einsum("eqi,qn->eni", normals, values)
    inward = np.einsum("eni,ei->e", result, area) < 0.0
    return np.where(inward[:, None, None], -result, result)
