"""What differs between the plane and space in the passes: how vectors and matrices lie in lanes.

A vector is one `Lanes` value. In the plane a matrix is one value, column by column, and (v, x) of a particle are
another; in space a matrix has three values, its columns. Matrices are tuples of lanes. `images`, `k` and `b` name a
neighbour: the particle in row b, or the image of it that the pair k has; see `lists.Images`.
"""

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import (
    WIDTH,
    broadcast,
    from_floats,
    fused,
    lane,
    load,
    swizzle,
    total,
)
from parsolid.numerics.layout import Plane
from parsolid.pairs.lists import PLANE_IMAGE, SPACE_IMAGE
from parsolid.pairs.terms import KINEMATICS

_PLANE, _SPACE = KINEMATICS[2], KINEMATICS[3]
_rows = swizzle(0, 1, 0, 1)
_columns = swizzle(0, 0, 1, 1)
_swap = swizzle(2, 3, 0, 1)
_x = swizzle(0, 0, 0, 0)
_y = swizzle(1, 1, 1, 1)
_z = swizzle(2, 2, 2, 2)
_fourth = swizzle(3, 3, 3, 3)


# --- vectors -----------------------------------------------------------------------------------------------------


@generic
def reference(space, images, k, kinematics, b):
    """X of a neighbour."""


@reference.of(Plane)
def _reference_plane(space, images, k, kinematics, b):
    X = load(kinematics, b, _PLANE.reference)
    if images is None:
        return X
    reflection = load(images.table, images.code[k], PLANE_IMAGE.reflection)
    return fused(reflection, X, _swap(reflection))


@reference.otherwise
def _reference_space(space, images, k, kinematics, b):
    X = load(kinematics, b, _SPACE.reference)
    if images is None:
        return X
    return fused(
        load(images.table, images.code[k], SPACE_IMAGE.reflection),
        X,
        load(images.table, images.code[k], SPACE_IMAGE.shift),
    )


@register_jitable
def vector(images, k, kinematics, b, column):
    """A vector of a neighbour, Q times it for an image."""
    if images is None:
        return load(kinematics, b, column)
    return load(images.table, images.code[k], SPACE_IMAGE.signs) * load(kinematics, b, column)


@generic
def motion(space, images, k, kinematics, b):
    """v, x and X of a neighbour, as `steps` takes them."""


@motion.of(Plane)
def _motion_plane(space, images, k, kinematics, b):
    motion, X = load(kinematics, b, _PLANE.field), load(kinematics, b, _PLANE.reference)
    if images is None:
        return motion, X
    image = reference(space, images, k, kinematics, b)
    shifted = motion - from_floats(0.0, 0.0, lane(X, 0), lane(X, 1))
    mirrored = fused(load(images.table, images.code[k], PLANE_IMAGE.signs), shifted, broadcast(0.0))
    return mirrored + from_floats(0.0, 0.0, lane(image, 0), lane(image, 1)), image


@motion.otherwise
def _motion_space(space, images, k, kinematics, b):
    v, x, X = (
        load(kinematics, b, _SPACE.field),
        load(kinematics, b, _SPACE.position),
        load(kinematics, b, _SPACE.reference),
    )
    if images is None:
        return v, x, X
    Q = load(images.table, images.code[k], SPACE_IMAGE.signs)
    image = reference(space, images, k, kinematics, b)
    return Q * v, fused(Q, x - X, image), image


@generic
def steps(space, there, here):
    """Differences of v, x and X of two particles' `motion`."""


@steps.of(Plane)
def _steps_plane(space, there, here):
    step = there[0] - here[0]
    return _rows(step), _swap(step), there[1] - here[1]


@steps.otherwise
def _steps_space(space, there, here):
    return there[0] - here[0], there[1] - here[1], there[2] - here[2]


@generic
def within(space, value):
    """Lanes beyond the dimension set to zero, of values that have zero there in space."""


@within.of(Plane)
def _within_plane(space, value):
    return value * from_floats(1.0, 1.0, 0.0, 0.0)


@within.otherwise
def _within_space(space, value):
    return value


@generic
def dot(space, first, second):
    """The product of two vectors."""


@dot.of(Plane)
def _dot_plane(space, first, second):
    return lane(first, 0) * lane(second, 0) + lane(first, 1) * lane(second, 1)


@dot.otherwise
def _dot_space(space, first, second):
    return total(first * second)


@generic
def jump_factor(space, g):
    """The number beside g_ab in a pair's weight, in every lane that counts."""


@jump_factor.of(Plane)
def _jump_factor_plane(space, g):
    return from_floats(1.0, 1.0, 0.0, 0.0) * _z(g)


@jump_factor.otherwise
def _jump_factor_space(space, g):
    return _fourth(g)


# --- matrices ----------------------------------------------------------------------------------------------------


@generic
def matrix(space, array, row, column):
    """A matrix of a particle."""


@matrix.of(Plane)
def _matrix_plane(space, array, row, column):
    return (load(array, row, column),)


@matrix.otherwise
def _matrix_space(space, array, row, column):
    return load(array, row, column), load(array, row, column + WIDTH), load(array, row, column + 2 * WIDTH)


@generic
def stress_of(space, images, k, record, b, column):
    """A matrix of a neighbour, s Q P Q of an image."""


@stress_of.of(Plane)
def _stress_plane(space, images, k, record, b, column):
    if images is None:
        return (load(record, b, column),)
    return (load(images.table, images.code[k], PLANE_IMAGE.stress) * load(record, b, column),)


@stress_of.otherwise
def _stress_space(space, images, k, record, b, column):
    P = matrix(space, record, b, column)
    if images is None:
        return P
    Q = load(images.table, images.code[k], SPACE_IMAGE.signs)
    signed = Q * images.table[images.code[k], SPACE_IMAGE.stress_sign]
    return signed * P[0] * _x(Q), signed * P[1] * _y(Q), signed * P[2] * _z(Q)


@generic
def gradient_of(space, images, k, record, b, column):
    """A matrix of a neighbour, Q G R of an image."""


@gradient_of.of(Plane)
def _gradient_plane(space, images, k, record, b, column):
    if images is None:
        return (load(record, b, column),)
    return (load(images.table, images.code[k], PLANE_IMAGE.gradient) * load(record, b, column),)


@gradient_of.otherwise
def _gradient_space(space, images, k, record, b, column):
    G = matrix(space, record, b, column)
    if images is None:
        return G
    Q, R = (
        load(images.table, images.code[k], SPACE_IMAGE.signs),
        load(images.table, images.code[k], SPACE_IMAGE.reflection),
    )
    return Q * G[0] * _x(R), Q * G[1] * _y(R), Q * G[2] * _z(R)


@generic
def stiffness_of(space, images, k, record, b, column):
    """A matrix of a neighbour, Q C Q of an image."""


@stiffness_of.of(Plane)
def _stiffness_plane(space, images, k, record, b, column):
    C = load(record, b, column)
    if images is None:
        return (C,)
    Q = load(images.table, images.code[k], PLANE_IMAGE.signs)
    return (Q * _columns(Q) * C,)


@stiffness_of.otherwise
def _stiffness_space(space, images, k, record, b, column):
    C = matrix(space, record, b, column)
    if images is None:
        return C
    Q = load(images.table, images.code[k], SPACE_IMAGE.signs)
    return Q * C[0] * _x(Q), Q * C[1] * _y(Q), Q * C[2] * _z(Q)


@generic
def sum_times(space, A, B, g):
    """(A + B) g."""


@sum_times.of(Plane)
def _sum_times_plane(space, A, B, g):
    product = (A[0] + B[0]) * _columns(g)
    return product + _swap(product)


@sum_times.otherwise
def _sum_times_space(space, A, B, g):
    result = (A[0] + B[0]) * _x(g)
    result = fused(A[1] + B[1], _y(g), result)
    return fused(A[2] + B[2], _z(g), result)


@generic
def less_sum_times(space, start, A, B, X):
    """start - (A + B) X."""


@less_sum_times.of(Plane)
def _less_sum_times_plane(space, start, A, B, X):
    product = (A[0] + B[0]) * _columns(X)
    return start - (product + _swap(product))


@less_sum_times.otherwise
def _less_sum_times_space(space, start, A, B, X):
    start = start - (A[0] + B[0]) * _x(X)
    start = start - (A[1] + B[1]) * _y(X)
    return start - (A[2] + B[2]) * _z(X)


@generic
def outer(space, step, g):
    """The matrix step (x) g."""


@outer.of(Plane)
def _outer_plane(space, step, g):
    return (_rows(step) * _columns(g),)


@outer.otherwise
def _outer_space(space, step, g):
    return _x(g) * step, _y(g) * step, _z(g) * step
