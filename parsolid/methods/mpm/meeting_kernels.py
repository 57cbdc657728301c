"""Kernels of grid contact: what the particles of two fields around a node say of the face between them.

A field's particles give to the nodes of their stencils that both fields have, numbered 0..n-1, with the weight
V product of B-splines of degree 2 of the distances in cells. Particles near a mirror plane count with their images.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from decomposition.compiled import compiled

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


@register_jitable
def extent(edges, spacing, p, d, n):
    """Half the extent [m] of particle p's deformed domain along n, as that of the ellipsoid in it: F of the layout of
    material points."""
    square = 0.0
    for k in range(d):
        along = 0.0
        for i in range(d):
            along += n[i] * edges[i * d + k, p]
        square += (along * spacing[p, k]) ** 2
    return 0.5 * math.sqrt(square)


@register_jitable
def reach_along(cloud, p, s, m, d, edges, spacing, normal, unit):
    """`extent` of a particle's image along a node's normal (3,): not the domain is reflected, but the normal."""
    for k in range(d):
        unit[k] = normal[k] * cloud.signs[s, k] * (-1.0 if (m >> k) & 1 else 1.0)
    return extent(edges, spacing, p, d, unit)


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


@compiled(error_model="numpy")
def add_fits(cloud, d, shrunk, edges, spacing, total, fit, active, result):
    """Add to result (n, FIT + FORM) what a step of Newton's rule for the logistic regression `fit` (n, FIT) takes of a
    field whose weights sum up to total (n,); shrunk: factor on the extents of particles."""
    x, y, unit, normal = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    for c in cloud.cells:
        for n in range(cloud.start[c], cloud.start[c + 1]):
            p = cloud.order[n]
            for s in cloud.stencil[c]:
                a = cloud.node[s]
                if a < 0 or not active[a]:
                    continue
                weight = seen(cloud, p, s, d, x)
                if weight == 0.0:
                    continue
                length = math.sqrt(fit[a, 1] ** 2 + fit[a, 2] ** 2 + fit[a, 3] ** 2)
                for k in range(d):
                    normal[k] = fit[a, 1 + k] / length if length > 0.0 else 0.0
                for m in range(1 << d):
                    if turned(x, cloud.on_plane[s], m, d, y):
                        reach = reach_along(cloud, p, s, m, d, edges, spacing, normal, unit) * cloud.inverse * shrunk
                        add_to_fit(result[a], weight / total[a], cloud.side, fit[a], y, reach)


@compiled(error_model="numpy")
def find_extremes(cloud, d, edges, spacing, normal, active, result):
    """How far (n,) [m] a field reaches from a node along -side normal (n, 3), the largest of what result holds."""
    x, y = np.zeros(3), np.zeros(3)
    unit, length = np.zeros(3), 1.0 / cloud.inverse
    for c in cloud.cells:
        for n in range(cloud.start[c], cloud.start[c + 1]):
            p = cloud.order[n]
            for s in cloud.stencil[c]:
                a = cloud.node[s]
                if a < 0 or not active[a] or seen(cloud, p, s, d, x) == 0.0:
                    continue
                for m in range(1 << d):
                    if not turned(x, cloud.on_plane[s], m, d, y):
                        continue
                    along = 0.0
                    for k in range(d):
                        along += normal[a, k] * y[k]
                    reach = reach_along(cloud, p, s, m, d, edges, spacing, normal[a], unit)
                    result[a] = max(result[a], reach - cloud.side * along * length)
