"""Normals and gaps between two fields of material points at the nodes where both have mass.

The normal at a node is that of the plane which best parts the particles of both fields around it: logistic regression
(Nairn, Hammerquist, Smith, Comput. Methods Appl. Mech. Engrg. 362 (2020) 112859), each field of weight 1, with a slight
penalty on the steepness, which has no bound where a plane parts the fields. The gap is that of the particles' deformed
domains along the normal.

A field's particles count at the nodes of their stencils that both fields have, numbered 0..n-1, with the weight V times
the product of quadratic B-splines of the distances in cells. Particles near a mirror plane count with their images.
"""

import math
from typing import NamedTuple

import numpy as np

from parsolid.kernels import kernel

# coefficients of a fit: a number and a vector; entries of the upper triangle of its matrix of second derivatives
FIT, MATRIX = 4, 10


class FieldParticles(NamedTuple):
    """Particles of one field on one rank, and where they count.

    cells: those with a node of both fields; start, order, stencil: see `transfer.Cells`; places (count, 4) [m] of
    nodes; inverse: 1/h [1/m]; motion: see `transfer`; node (count,): number among the nodes of both, of its image for a
    node behind a mirror plane, -1 for others; signs (count, 3): of the image; on_plane (count,): bits of the axes whose
    plane a node lies on; side: -1.0 for the first field, 1.0 for the second.
    """

    cells: np.ndarray
    start: np.ndarray
    order: np.ndarray
    stencil: np.ndarray
    places: np.ndarray
    inverse: float
    motion: np.ndarray
    node: np.ndarray
    signs: np.ndarray
    on_plane: np.ndarray
    side: float


class Seen(NamedTuple):
    """Particles of both fields near nodes, those of node a in rows start[a]..start[a + 1].

    place (k, 3): from the node, in cells; share (k,): of its field's weight; side (k,); form (k, 6): Q in n . Q n, the
    square of half the extent along n of the particle's deformed domain, in cells, as of the ellipsoid in it; its
    diagonal and 12, 13, 23.
    """

    start: np.ndarray
    place: np.ndarray
    share: np.ndarray
    side: np.ndarray
    form: np.ndarray


@kernel
def look(field, p, s, d, x):
    """Place x (3,) of particle p from node s in cells, as its image has it; its weight [m^3]."""
    weight = field.motion[p, 7]
    for k in range(d):
        x[k] = (field.motion[p, k] - field.places[s, k]) * field.inverse
        q = abs(x[k])
        weight *= 0.75 - q * q if q < 0.5 else (0.5 * (1.5 - q) ** 2 if q < 1.5 else 0.0)
        x[k] *= field.signs[s, k]
    return weight


@kernel
def reflect(x, planes, m, d, y):
    """x into y (3,), reflected along the axes of the bits of m; False where these are no planes."""
    for k in range(d):
        y[k] = -x[k] if (m >> k) & 1 else x[k]
    return m & ~planes == 0


@kernel
def add_weights(field, d, result):
    """Add the weights of all particles to a column (n,)."""
    x, y = np.zeros(3), np.zeros(3)
    for c in field.cells:
        for n in range(field.start[c], field.start[c + 1]):
            for s in field.stencil[c]:
                if field.node[s] >= 0:
                    weight = look(field, field.order[n], s, d, x)
                    for m in range(1 << d):
                        if reflect(x, field.on_plane[s], m, d, y):
                            result[field.node[s]] += weight


@kernel
def count_seen(field, d, active, count):
    """Add to count (n,) how many rows of `Seen` active nodes have of a field."""
    x, y = np.zeros(3), np.zeros(3)
    for c in field.cells:
        for n in range(field.start[c], field.start[c + 1]):
            for s in field.stencil[c]:
                a = field.node[s]
                if a >= 0 and active[a] and look(field, field.order[n], s, d, x) > 0.0:
                    for m in range(1 << d):
                        if reflect(x, field.on_plane[s], m, d, y):
                            count[a] += 1


@kernel
def put_seen(field, d, deformation, spacing, total, active, free, seen):
    """The rows of a field whose weights sum up to total (n,), from free (n,) on, which moves on.

    deformation: F, see `hyperelastic_particles.load_gradient`; spacing (capacity, d) [m].
    """
    x, y, form, edge = np.zeros(3), np.zeros(3), np.zeros(6), np.zeros((3, 3))
    for c in field.cells:
        for n in range(field.start[c], field.start[c + 1]):
            p = field.order[n]
            for i in range(d):
                for k in range(d):
                    edge[i, k] = 0.5 * deformation[i * d + k, p] * spacing[p, k] * field.inverse
            for i in range(3):
                form[i] = edge[i, 0] ** 2 + edge[i, 1] ** 2 + edge[i, 2] ** 2
            form[3] = (edge[0] * edge[1]).sum()
            form[4] = (edge[0] * edge[2]).sum()
            form[5] = (edge[1] * edge[2]).sum()
            for s in field.stencil[c]:
                a = field.node[s]
                if a < 0 or not active[a]:
                    continue
                weight = look(field, p, s, d, x)
                if weight == 0.0:
                    continue
                for m in range(1 << d):
                    if reflect(x, field.on_plane[s], m, d, y):
                        row = free[a]
                        seen.place[row], seen.form[row] = y, form
                        one = -field.signs[s, 0] if m & 1 else field.signs[s, 0]
                        two = -field.signs[s, 1] if m & 2 else field.signs[s, 1]
                        three = -field.signs[s, 2] if m & 4 else field.signs[s, 2]
                        seen.form[row, 3] *= one * two
                        seen.form[row, 4] *= one * three
                        seen.form[row, 5] *= two * three
                        seen.share[row], seen.side[row] = weight / total[a], field.side
                        free[a] += 1


@kernel
def half_extent(form, n):
    """Half the extent of a domain along n (3,), in cells."""
    square = form[0] * n[0] ** 2 + form[1] * n[1] ** 2 + form[2] * n[2] ** 2
    return math.sqrt(max(square + 2.0 * (form[3] * n[0] * n[1] + form[4] * n[0] * n[2] + form[5] * n[1] * n[2]), 0.0))


@kernel
def add_node(seen, a, shrunk, fit, normal, row):
    """Contribution of all particles near a node to a step of Newton's method, into a row (FIT + MATRIX,); normal (3,)
    is scratch.

    Gradient and second derivatives of share log(1 + exp(-z)), z = side (fit . (1, y)) - extent |fit|.
    """
    length = math.sqrt(fit[1] ** 2 + fit[2] ** 2 + fit[3] ** 2)
    over = max(length, 1e-300)
    for k in range(3):
        normal[k] = fit[1 + k] / length if length > 0.0 else 0.0
    for k in range(seen.start[a], seen.start[a + 1]):
        y, side, extent = seen.place[k], seen.side[k], shrunk * half_extent(seen.form[k], normal)
        z = side * (fit[0] + fit[1] * y[0] + fit[2] * y[1] + fit[3] * y[2]) - extent * length
        chance = seen.share[k] / (1.0 + math.exp(min(z, 500.0)))
        curvature, bent, at = chance * (1.0 - chance / seen.share[k]), chance * extent / over, FIT
        for i in range(FIT):
            one = side if i == 0 else side * y[i - 1] - extent * fit[i] / over
            row[i] -= chance * one
            for j in range(i, FIT):
                row[at] += curvature * one * (side if j == 0 else side * y[j - 1] - extent * fit[j] / over)
                if i > 0 and extent > 0.0:
                    row[at] += bent * ((1.0 if i == j else 0.0) - fit[i] / over * fit[j] / over)
                at += 1


@kernel
def add_fits(seen, shrunk, fit, moving, result):
    """Add to result (n, FIT + MATRIX) what a step of Newton's method for the fits (n, FIT) takes; shrunk: factor on the
    extents of particles."""
    normal = np.zeros(3)
    for a in range(len(fit)):
        if moving[a]:
            add_node(seen, a, shrunk, fit[a], normal, result[a])


@kernel
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


@kernel
def find_fits(seen, shrunk, penalties, eased, tolerance, moving, fit):
    """Newton's method for the nodes that move, each until a step is below the tolerance times its fit; penalties
    (turns, FIT): no node stops before turn `eased`, from which on they are the last ones."""
    row, change, normal, matrix = np.zeros(FIT + MATRIX), np.zeros(FIT), np.zeros(3), np.zeros((FIT, FIT))
    for a in range(len(fit)):
        if not moving[a]:
            continue
        for turn in range(len(penalties)):
            row[:] = 0.0
            add_node(seen, a, shrunk, fit[a], normal, row)
            square = newton_change(row, fit[a], penalties[turn], matrix, change)
            fit[a] -= change
            if turn >= eased and square <= tolerance**2 * (fit[a] ** 2).sum():
                break


@kernel
def find_extremes(seen, normal, active, spacing, result):
    """Largest distance (n, 2) [m] of both fields from a node along -side normal (n, 3), or that in result if larger."""
    for a in range(len(active)):
        if active[a]:
            for k in range(seen.start[a], seen.start[a + 1]):
                y, n, side = seen.place[k], normal[a], seen.side[k]
                along = half_extent(seen.form[k], n) - side * (y[0] * n[0] + y[1] * n[1] + y[2] * n[2])
                field = 0 if side < 0.0 else 1
                result[a, field] = max(result[a, field], along * spacing)
