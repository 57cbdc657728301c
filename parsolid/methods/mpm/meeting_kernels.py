"""Kernels of grid contact: what the particles of two fields around a node say of the face between them.

A field's particles give to the nodes of their stencils that both fields have, numbered 0..n-1, with the weight
V product of B-splines of degree 2 of the distances in cells. Particles near a mirror plane count with their images.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable

# coefficients of a fit: a number and a vector, and of its quadratic form the upper triangle
FIT, FORM = 4, 10


class Cloud(NamedTuple):
    """Particles of one field on one rank, and where they count.

    cells: those with a node of both fields; start, order, stencil: see `grid.Grid`; places (count, 4) [m] of nodes;
    inverse: 1/h [1/m]; motion: see `grid`; node (count,): number among the nodes of both, of its image for a node
    behind a mirror plane, -1 for others; signs (count, 3): of the image; on_plane (count,): bits of the axes whose
    plane a node lies on; side: -1.0 for the first field, 1.0 for the second.
    """

    cells: Any
    start: Any
    order: Any
    stencil: Any
    places: Any
    inverse: float
    motion: Any
    node: Any
    signs: Any
    on_plane: Any
    side: float


class Points(NamedTuple):
    """What nodes see, those of node a in rows start[a]..start[a + 1]: place (k, 3) from it, in cells, share (k,) of its
    field's weight, side (k,) of `Cloud`, form (k, 6): Q in n . Q n, the square of half the extent along n of the
    deformed domain, in cells, as of the ellipsoid in it; its diagonal and 12, 13, 23."""

    start: Any
    place: Any
    share: Any
    side: Any
    form: Any


@register_jitable
def spline(q):
    """The B-spline of degree 2."""
    q = abs(q)
    if q < 0.5:
        return 0.75 - q * q
    return 0.5 * (1.5 - q) ** 2 if q < 1.5 else 0.0


@register_jitable
def seen(cloud, p, s, d, x):
    """Place x (3,) of particle p from node s in cells, as its image has it; its weight [m^3]."""
    weight = cloud.motion[p, 7]
    for k in range(d):
        x[k] = (cloud.motion[p, k] - cloud.places[s, k]) * cloud.inverse
        weight *= spline(x[k])
        x[k] *= cloud.signs[s, k]
    return weight


@register_jitable
def turned(x, images, m, d, y):
    """x into y (3,), reflected along the axes of the bits of m; False where these are no images."""
    for k in range(d):
        y[k] = -x[k] if (m >> k) & 1 else x[k]
    return m & ~images == 0


@compiled(error_model="numpy")
def add_weights(cloud, d, result):
    """Add the weights of all particles to a column (n,)."""
    x, y = np.zeros(3), np.zeros(3)
    for c in cloud.cells:
        for n in range(cloud.start[c], cloud.start[c + 1]):
            for s in cloud.stencil[c]:
                if cloud.node[s] >= 0:
                    weight = seen(cloud, cloud.order[n], s, d, x)
                    for m in range(1 << d):
                        if turned(x, cloud.on_plane[s], m, d, y):
                            result[cloud.node[s]] += weight


@compiled(error_model="numpy")
def count_points(cloud, d, active, count):
    """Add to count (n,) how many rows of `Points` active nodes have of a field."""
    x, y = np.zeros(3), np.zeros(3)
    for c in cloud.cells:
        for n in range(cloud.start[c], cloud.start[c + 1]):
            for s in cloud.stencil[c]:
                a = cloud.node[s]
                if a >= 0 and active[a] and seen(cloud, cloud.order[n], s, d, x) > 0.0:
                    for m in range(1 << d):
                        if turned(x, cloud.on_plane[s], m, d, y):
                            count[a] += 1


@compiled(error_model="numpy")
def put_points(cloud, d, edges, spacing, total, active, free, points):
    """The rows of a field whose weights sum up to total (n,), from free (n,) on, which moves on; F of the layout of
    material points."""
    x, y, form, edge = np.zeros(3), np.zeros(3), np.zeros(6), np.zeros((3, 3))
    for c in cloud.cells:
        for n in range(cloud.start[c], cloud.start[c + 1]):
            p = cloud.order[n]
            for i in range(d):
                for k in range(d):
                    edge[i, k] = 0.5 * edges[i * d + k, p] * spacing[p, k] * cloud.inverse
            form_of(edge, form)
            for s in cloud.stencil[c]:
                a = cloud.node[s]
                if a < 0 or not active[a]:
                    continue
                weight = seen(cloud, p, s, d, x)
                if weight == 0.0:
                    continue
                for m in range(1 << d):
                    if turned(x, cloud.on_plane[s], m, d, y):
                        row = free[a]
                        points.place[row], points.form[row] = y, form
                        reflect(points.form[row], cloud.signs[s], m)
                        points.share[row], points.side[row] = weight / total[a], cloud.side
                        free[a] += 1


@register_jitable
def form_of(edge, form):
    """E E^T (6,) of half edges (3, 3)."""
    for k in range(3):
        form[k] = (edge[k] ** 2).sum()
    form[3] = (edge[0] * edge[1]).sum()
    form[4] = (edge[0] * edge[2]).sum()
    form[5] = (edge[1] * edge[2]).sum()


@register_jitable
def reflect(form, signs, m):
    """The form of an image: of a node's signs (3,), and along the axes of the bits of m."""
    one, two, three = signs[0], signs[1], signs[2]
    if m & 1:
        one = -one
    if m & 2:
        two = -two
    if m & 4:
        three = -three
    form[3] *= one * two
    form[4] *= one * three
    form[5] *= two * three


@register_jitable
def reach_along(form, n):
    """Half the extent along n (3,), in cells."""
    square = form[0] * n[0] ** 2 + form[1] * n[1] ** 2 + form[2] * n[2] ** 2
    return math.sqrt(max(square + 2.0 * (form[3] * n[0] * n[1] + form[4] * n[0] * n[2] + form[5] * n[1] * n[2]), 0.0))


@register_jitable
def add_to_fit(row, share, side, fit, y, reach):
    """Gradient and quadratic form of share log(1 + exp(-z)), z = side (fit . (1, y)) - reach |fit|, into a row."""
    length = math.sqrt(fit[1] ** 2 + fit[2] ** 2 + fit[3] ** 2)
    z, over = side * (fit[0] + fit[1] * y[0] + fit[2] * y[1] + fit[3] * y[2]) - reach * length, max(length, 1e-300)
    chance = share / (1.0 + math.exp(min(z, 500.0)))
    curvature, bent, at = chance * (1.0 - chance / share), chance * reach / over, FIT
    for i in range(FIT):
        one = side if i == 0 else side * y[i - 1] - reach * fit[i] / over
        row[i] -= chance * one
        for j in range(i, FIT):
            row[at] += curvature * one * (side if j == 0 else side * y[j - 1] - reach * fit[j] / over)
            if i > 0 and reach > 0.0:
                row[at] += bent * ((1.0 if i == j else 0.0) - fit[i] / over * fit[j] / over)
            at += 1


@register_jitable
def add_node(points, a, shrunk, fit, normal, row):
    """What all points of a node add to a step of Newton's rule, into a row (FIT + FORM,); normal (3,) is scratch."""
    length = math.sqrt(fit[1] ** 2 + fit[2] ** 2 + fit[3] ** 2)
    for k in range(3):
        normal[k] = fit[1 + k] / length if length > 0.0 else 0.0
    for k in range(points.start[a], points.start[a + 1]):
        reach = shrunk * reach_along(points.form[k], normal)
        add_to_fit(row, points.share[k], points.side[k], fit, points.place[k], reach)


@compiled(error_model="numpy")
def add_fits(points, shrunk, fit, moving, result):
    """Add to result (n, FIT + FORM) what a step of Newton's rule for the logistic regression `fit` (n, FIT) takes;
    shrunk: factor on the extents of particles."""
    normal = np.zeros(3)
    for a in range(len(fit)):
        if moving[a]:
            add_node(points, a, shrunk, fit[a], normal, result[a])


@register_jitable
def newton_change(row, fit, penalty, matrix, change):
    """Solve (H + penalty) change = g + penalty fit by elimination, g and H in a row; the square of the change. matrix
    (FIT, FIT) is scratch."""
    at, square = FIT, 0.0
    for i in range(FIT):
        change[i] = row[i] + penalty[i] * fit[i]
        for j in range(i, FIT):
            matrix[i, j] = row[at] + (penalty[i] if i == j else 0.0)
            at += 1
    for i in range(FIT):
        for j in range(i + 1, FIT):
            factor = matrix[i, j] / matrix[i, i]
            for k in range(j, FIT):
                matrix[j, k] -= factor * matrix[i, k]
            change[j] -= factor * change[i]
    for i in range(FIT - 1, -1, -1):
        for j in range(i + 1, FIT):
            change[i] -= matrix[i, j] * change[j]
        change[i] /= matrix[i, i]
        square += change[i] ** 2
    return square


@compiled(error_model="numpy")
def find_fits(points, shrunk, penalties, free, left, moving, fit):
    """Newton's rule for the nodes that move, each until a step is below left of its fit; a turn's penalties (FIT,) are
    a row, those from turn `free` on the last ones."""
    row, change, normal, matrix = np.zeros(FIT + FORM), np.zeros(FIT), np.zeros(3), np.zeros((FIT, FIT))
    for a in range(len(fit)):
        if not moving[a]:
            continue
        for turn in range(len(penalties)):
            row[:] = 0.0
            add_node(points, a, shrunk, fit[a], normal, row)
            square = newton_change(row, fit[a], penalties[turn], matrix, change)
            fit[a] -= change
            if turn >= free and square <= left**2 * (fit[a] ** 2).sum():
                break


@compiled(error_model="numpy")
def find_extremes(points, normal, active, length, result):
    """How far (n, 2) [m] the fields reach from a node along -side normal (n, 3), the largest of what result holds;
    length [m] of a cell."""
    for a in range(len(active)):
        if active[a]:
            for k in range(points.start[a], points.start[a + 1]):
                y, n, side = points.place[k], normal[a], points.side[k]
                along = reach_along(points.form[k], n) - side * (y[0] * n[0] + y[1] * n[1] + y[2] * n[2])
                field = 0 if side < 0.0 else 1
                result[a, field] = max(result[a, field], along * length)
