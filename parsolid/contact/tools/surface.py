"""Signed distance of a closed surface of triangles (3-D) or segments (2-D), found in a tree of boxes.

The sign is that of the pseudo-normal of the nearest face, edge or corner (Baerentzen and Aanaes, IEEE Trans. Vis.
Comput. Graph. 11 (2005) 243), exact for any closed surface that does not cut itself.
"""

import math
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

_LEAF, _DEEPEST = 4, 64


class Surface(NamedTuple):
    """Facets, and a tree of boxes over them.

    corners (m, 3, 3) [m]: of triangles; a segment is the edge in the plane Z = 0 of a triangle across it; normals
    (m, 7, 3): of the face, of the edges opposite to the corners, and of the corners.
    boxes (k, 2, 3): lower and upper bounds; children (k, 2): first facet and -count of a leaf, else two boxes.
    """

    corners: np.ndarray
    normals: np.ndarray
    boxes: np.ndarray
    children: np.ndarray


NO_SURFACE = Surface(np.zeros((0, 3, 3)), np.zeros((0, 7, 3)), np.zeros((0, 2, 3)), np.zeros((0, 2), np.int64))


def make_surface(points: np.ndarray, facets: np.ndarray) -> Surface:
    """The surface of points (n, d) [m] and facets (m, d) with outward normals; facets are sorted as in the tree."""
    dimension = points.shape[1]
    corners = np.zeros((len(facets), 3, 3))
    corners[:, :dimension, :dimension] = points[facets]
    bounds = corners[:, :dimension]
    order, boxes, children = _tree(bounds.min(axis=1), bounds.max(axis=1))
    if dimension == 2:
        # above the first corner: no place in the plane is nearest to it
        corners[:, 2] = corners[:, 0]
        corners[:, 2, 2] = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    normals = _pseudo_normals(corners, facets)
    return Surface(corners[order], normals[order], boxes, children)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.finfo(float).tiny))


def _pseudo_normals(corners: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Normals of faces, edges (sums of two faces) and corners (sums weighted by angles), see `Surface.normals`."""
    dimension = facets.shape[1]
    face = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    # a segment has one edge in the plane, with the normal of its face
    result, weighted = np.repeat(face[:, None], 7, axis=1), np.zeros((facets.max() + 1, 3))
    for i in range(dimension):
        angle = np.ones(len(facets))
        if dimension == 3:
            sides = [_unit(corners[:, (i + step) % 3] - corners[:, i]) for step in (1, 2)]
            angle = np.arccos(np.clip((sides[0] * sides[1]).sum(axis=1), -1.0, 1.0))
        np.add.at(weighted, facets[:, i], angle[:, None] * face)
    result[:, 4 : 4 + dimension] = _unit(weighted)[facets]
    if dimension == 3:
        edges = np.stack([np.sort(facets[:, [(i + 1) % 3, (i + 2) % 3]], axis=1) for i in range(3)], axis=1)
        _, place = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
        sums = np.zeros((place.max() + 1, 3))
        np.add.at(sums, place.ravel(), np.repeat(face, 3, axis=0))
        result[:, 1:4] = _unit(sums[place.reshape(-1, 3)])
    return result


def _tree(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Order (m,) of facets with bounds (m, 3), boxes and children; halves along the widest side of the middles."""
    middle, order = lower + upper, np.arange(len(lower))
    boxes: list[np.ndarray] = []
    children: list[tuple[int, int]] = []

    def add(first: int, last: int) -> int:
        here, number = order[first:last].copy(), len(boxes)
        boxes.append(np.stack([lower[here].min(axis=0), upper[here].max(axis=0)]))
        children.append((first, first - last))
        if last - first > _LEAF:
            axis = int(np.argmax(np.ptp(middle[here], axis=0)))
            half = (last - first) // 2
            order[first:last] = here[np.argpartition(middle[here, axis], half)]
            children[number] = add(first, first + half), add(first + half, last)
        return number

    add(0, len(order))
    return order, np.array(boxes), np.array(children)


# --- the nearest place ---------------------------------------------------------------------------------------------


@register_jitable
def _away_from_box(boxes, k, x, y, z):
    """Squared distance of a place from a box [m^2]."""
    a = max(boxes[k, 0, 0] - x, x - boxes[k, 1, 0], 0.0)
    b = max(boxes[k, 0, 1] - y, y - boxes[k, 1, 1], 0.0)
    c = max(boxes[k, 0, 2] - z, z - boxes[k, 1, 2], 0.0)
    return a * a + b * b + c * c


@register_jitable
def _on_triangle(c, m, x, y, z):
    """(u, v, feature) of the point a + u (b - a) + v (c - a) of a triangle nearest to (x, y, z) (Ericson, Real-Time
    Collision Detection, 2005, section 5.1.5)."""
    ax, ay, az = c[m, 0, 0], c[m, 0, 1], c[m, 0, 2]
    bx, by, bz = c[m, 1, 0] - ax, c[m, 1, 1] - ay, c[m, 1, 2] - az
    cx, cy, cz = c[m, 2, 0] - ax, c[m, 2, 1] - ay, c[m, 2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    d1, d2 = bx * px + by * py + bz * pz, cx * px + cy * py + cz * pz
    if d1 <= 0.0 and d2 <= 0.0:
        return 0.0, 0.0, 4
    bb, bc, cc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz, cx * cx + cy * cy + cz * cz
    d3, d4 = d1 - bb, d2 - bc
    if d3 >= 0.0 and d4 <= d3:
        return 1.0, 0.0, 5
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return d1 / (d1 - d3), 0.0, 3
    d5, d6 = d1 - bc, d2 - cc
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 1.0, 6
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return 0.0, d2 / (d2 - d6), 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 1.0 - w, w, 1
    total = va + vb + vc
    return vb / total, vc / total, 0


@register_jitable
def _to_facet(shape, m, x, y, z):
    """Vector from the nearest point of a facet to (x, y, z), and its feature."""
    c = shape.corners
    u, v, feature = _on_triangle(c, m, x, y, z)
    w = 1.0 - u - v
    dx = x - (w * c[m, 0, 0] + u * c[m, 1, 0] + v * c[m, 2, 0])
    dy = y - (w * c[m, 0, 1] + u * c[m, 1, 1] + v * c[m, 2, 1])
    dz = z - (w * c[m, 0, 2] + u * c[m, 1, 2] + v * c[m, 2, 2])
    return dx, dy, dz, feature


@register_jitable
def surface_distance(shape, x, y, z, reach):
    """(signed distance [m], its gradient (3 numbers)) at a place [m]; more than `reach` may be any number above it."""
    # outside of the box by more than `reach`
    best = _away_from_box(shape.boxes, 0, x, y, z)
    if best > reach * reach:
        return math.sqrt(best), 1.0, 0.0, 0.0
    best, facet, feature, ux, uy, uz = math.inf, 0, 0, 1.0, 0.0, 0.0
    # depth-first search, the nearer box first, so that at most one box a level waits
    k, w0, w1, waiting = 0, np.empty(_DEEPEST, np.int64), np.empty(_DEEPEST), 0
    while True:
        one, two = shape.children[k, 0], shape.children[k, 1]
        if two < 0:
            for m in range(one, one - two):
                dx, dy, dz, part = _to_facet(shape, m, x, y, z)
                square = dx * dx + dy * dy + dz * dz
                if square < best:
                    best, facet, feature, ux, uy, uz = square, m, part, dx, dy, dz
        else:
            near, far = _away_from_box(shape.boxes, one, x, y, z), _away_from_box(shape.boxes, two, x, y, z)
            if far < near:
                one, two, near, far = two, one, far, near
            if far < best:
                w0[waiting], w1[waiting] = two, far
                waiting += 1
            if near < best:
                k = one
                continue
        while waiting > 0 and w1[waiting - 1] >= best:
            waiting -= 1
        if waiting == 0:
            break
        waiting -= 1
        k = w0[waiting]
    n, away = shape.normals[facet, feature], math.sqrt(best)
    nx, ny, nz = n[0], n[1], n[2]
    if away == 0.0:
        return 0.0, nx, ny, nz
    sign = -1.0 if ux * nx + uy * ny + uz * nz < 0.0 else 1.0
    return sign * away, sign * ux / away, sign * uy / away, sign * uz / away
