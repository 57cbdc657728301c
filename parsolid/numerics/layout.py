"""How the state of four neighbouring particles is loaded from and stored to arrays, by dimension.

`deformation` is (19, capacity) in space: F (9 rows), H (9), J; and (5, capacity) in plane strain: F (4), J, since
there H = cof F exactly (linear in F), with H33 = J. `branches` is (6 n, capacity) or (3 n, capacity): A11, A22, A33,
A12, A13, A23 or A11, A22, A12 of each Maxwell branch. `correction` holds L, (9 or 4, capacity).
"""

from typing import NamedTuple

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import broadcast, load, store, store_first, transpose
from parsolid.numerics.tensors import GeneralPlane, GeneralSpace, SymmetricPlane, SymmetricSpace


class Plane(NamedTuple):
    """Plane strain."""

    dimension: int = 2


class Axisymmetric(NamedTuple):
    """Axisymmetry without torsion: x is the radius, y runs along the axis, volumes and masses are those of a radian."""

    dimension: int = 2


class Space(NamedTuple):
    """Three dimensions."""

    dimension: int = 3


LAYOUT = {2: Plane(), 3: Space()}
DEFORMATION_ROWS = {2: 5, 3: 19}
# F and J alone, where H and J follow from F
GRADIENT_ROWS = {2: 5, 3: 10}
BRANCH_ROWS = {2: 3, 3: 6}
CORRECTION_ROWS = {2: 4, 3: 9}


@generic
def load_deformation(space, deformation, i):
    """F, H, J of particles i..i+3."""


@load_deformation.of(Plane)
def _plane_deformation(space, deformation, i):
    F11, F12 = load(deformation, 0, i), load(deformation, 1, i)
    F21, F22, J = load(deformation, 2, i), load(deformation, 3, i), load(deformation, 4, i)
    return GeneralPlane(F11, F12, F21, F22, broadcast(1.0)), GeneralPlane(F22, -F21, -F12, F11, J), J


@load_deformation.otherwise
def _space_deformation(space, deformation, i):
    return load_nine(deformation, 0, i), load_nine(deformation, 9, i), load(deformation, 18, i)


@register_jitable
def _three(array, row, i):
    """Three consecutive rows of four particles."""
    return load(array, row, i), load(array, row + 1, i), load(array, row + 2, i)


@register_jitable
def load_nine(array, row, i):
    """Nine consecutive rows of four particles, as a general tensor."""
    x, y, z = _three(array, row, i), _three(array, row + 3, i), _three(array, row + 6, i)
    return GeneralSpace(x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2])


@generic
def load_deformation_gradient(space, rows, i):
    """F alone of particles i..i+3, from the first rows of an array."""


@load_deformation_gradient.of(Plane)
def _plane_gradient_of_deformation(space, rows, i):
    return GeneralPlane(load(rows, 0, i), load(rows, 1, i), load(rows, 2, i), load(rows, 3, i), broadcast(1.0))


@load_deformation_gradient.otherwise
def _space_gradient_of_deformation(space, rows, i):
    return load_nine(rows, 0, i)


@generic
def store_deformation_gradient(space, rows, i, F, J, count):
    """Store F and J, one behind the other, of the first `count` of particles i..i+3."""


@store_deformation_gradient.of(Plane)
def _store_plane_gradient(space, rows, i, F, J, count):
    store_deformation(space, rows, i, F, F, J, count)


@store_deformation_gradient.otherwise
def _store_space_gradient(space, rows, i, F, J, count):
    store_nine(rows, 0, i, F, count)
    store_first(rows, 9, i, J, count)


@generic
def store_deformation(space, deformation, i, F, H, J, count):
    """Store F, H, J of the first `count` of particles i..i+3."""


@store_deformation.of(Plane)
def _store_plane_deformation(space, deformation, i, F, H, J, count):
    store_first(deformation, 0, i, F[0], count)
    store_first(deformation, 1, i, F[1], count)
    store_first(deformation, 2, i, F[2], count)
    store_first(deformation, 3, i, F[3], count)
    store_first(deformation, 4, i, J, count)


@store_deformation.otherwise
def _store_space_deformation(space, deformation, i, F, H, J, count):
    store_nine(deformation, 0, i, F, count)
    store_nine(deformation, 9, i, H, count)
    store_first(deformation, 18, i, J, count)


@register_jitable
def store_nine(array, row, i, values, count):
    """Nine consecutive rows of the first `count` of particles i..i+3."""
    store_first(array, row, i, values[0], count)
    store_first(array, row + 1, i, values[1], count)
    store_first(array, row + 2, i, values[2], count)
    store_first(array, row + 3, i, values[3], count)
    store_first(array, row + 4, i, values[4], count)
    store_first(array, row + 5, i, values[5], count)
    store_first(array, row + 6, i, values[6], count)
    store_first(array, row + 7, i, values[7], count)
    store_first(array, row + 8, i, values[8], count)


@generic
def load_branch(space, branches, alpha, i):
    """A_alpha of particles i..i+3."""


@load_branch.of(Plane)
def _plane_branch(space, branches, alpha, i):
    row = 3 * alpha
    return SymmetricPlane(
        load(branches, row, i), load(branches, row + 1, i), broadcast(1.0), load(branches, row + 2, i)
    )


@load_branch.otherwise
def _space_branch(space, branches, alpha, i):
    return load_six(branches, 6 * alpha, i)


@register_jitable
def load_six(array, row, i):
    """Six consecutive rows of four particles, as a symmetric tensor."""
    x, y = _three(array, row, i), _three(array, row + 3, i)
    return SymmetricSpace(x[0], x[1], x[2], y[0], y[1], y[2])


@generic
def store_branch(space, branches, alpha, i, A, count):
    """Store A_alpha of the first `count` of particles i..i+3."""


@store_branch.of(Plane)
def _store_plane_branch(space, branches, alpha, i, A, count):
    store_first(branches, 3 * alpha, i, A[0], count)
    store_first(branches, 3 * alpha + 1, i, A[1], count)
    store_first(branches, 3 * alpha + 2, i, A[3], count)


@store_branch.otherwise
def _store_space_branch(space, branches, alpha, i, A, count):
    row = 6 * alpha
    store_first(branches, row, i, A[0], count)
    store_first(branches, row + 1, i, A[1], count)
    store_first(branches, row + 2, i, A[2], count)
    store_first(branches, row + 3, i, A[3], count)
    store_first(branches, row + 4, i, A[4], count)
    store_first(branches, row + 5, i, A[5], count)


@generic
def load_correction(space, correction, i):
    """L of particles i..i+3 as a general tensor."""


@load_correction.of(Plane)
def _plane_correction(space, correction, i):
    return GeneralPlane(
        load(correction, 0, i),
        load(correction, 1, i),
        load(correction, 2, i),
        load(correction, 3, i),
        broadcast(0.0),
    )


@load_correction.otherwise
def _space_correction(space, correction, i):
    return load_nine(correction, 0, i)


@generic
def load_gradient(space, gradient, i):
    """sum (v_b - v_a) (x) g of particles i..i+3, stored particle by particle in columns, as a general tensor."""


@load_gradient.of(Plane)
def _plane_gradient(space, gradient, i):
    c = four_rows(gradient, i, 0)
    return GeneralPlane(c[0], c[2], c[1], c[3], broadcast(0.0))


@load_gradient.otherwise
def _space_gradient(space, gradient, i):
    x, y, z = four_rows(gradient, i, 0), four_rows(gradient, i, 4), four_rows(gradient, i, 8)
    return GeneralSpace(x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])


@register_jitable
def four_rows(array, i, column):
    """Columns column..column+3 of the rows i..i+3, as lanes over the rows."""
    return transpose(
        load(array, i, column), load(array, i + 1, column), load(array, i + 2, column), load(array, i + 3, column)
    )


@register_jitable
def store_rows(array, i, column, first, second, third, fourth):
    """Lanes over particles into array[i..i+3, column : column + 4]."""
    rows = transpose(first, second, third, fourth)
    store(array, i, column, rows[0])
    store(array, i + 1, column, rows[1])
    store(array, i + 2, column, rows[2])
    store(array, i + 3, column, rows[3])


@generic
def store_matrix(space, record, i, column, matrix):
    """The columns of a general tensor of particles i..i+3 into their records."""


@store_matrix.of(Plane)
def _store_plane_matrix(space, record, i, column, matrix):
    store_rows(record, i, column, matrix[0], matrix[2], matrix[1], matrix[3])


@store_matrix.otherwise
def _store_space_matrix(space, record, i, column, matrix):
    zero = broadcast(0.0)
    store_rows(record, i, column, matrix[0], matrix[3], matrix[6], zero)
    store_rows(record, i, column + 4, matrix[1], matrix[4], matrix[7], zero)
    store_rows(record, i, column + 8, matrix[2], matrix[5], matrix[8], zero)


@generic
def store_tensor(space, record, i, column, tensor, last):
    """A symmetric tensor of particles i..i+3 into their records, with one more number in its free lane."""


@store_tensor.of(Plane)
def _store_plane_tensor(space, record, i, column, tensor, last):
    store_rows(record, i, column, broadcast(tensor[0]), broadcast(tensor[1]), broadcast(tensor[3]), broadcast(last))


@store_tensor.otherwise
def _store_space_tensor(space, record, i, column, tensor, last):
    zero = broadcast(0.0)
    store_rows(record, i, column, broadcast(tensor[0]), broadcast(tensor[1]), broadcast(tensor[2]), broadcast(last))
    store_rows(record, i, column + 4, broadcast(tensor[3]), broadcast(tensor[4]), broadcast(tensor[5]), zero)
