"""Symmetric tensors of a neighbour along the weight of a pair, in the plane and in space; see `pairs.primitives`.

A tensor lies in lanes as its columns do in the record (see `pairs.terms`); a dyad g (x) g likewise, its off-diagonal
part twice.
"""

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import WIDTH, from_floats, fused, lane, load, swizzle, without_fourth
from parsolid.numerics.layout import Plane
from parsolid.pairs.lists import PLANE_IMAGE, SPACE_IMAGE

_cross_first = swizzle(0, 0, 1, 3)
_cross_second = swizzle(1, 2, 2, 3)


@generic
def symmetric_of(space, images, k, record, b, column):
    """A symmetric tensor of a neighbour, R S R of an image; the free lane stays."""


@symmetric_of.of(Plane)
def _symmetric_plane(space, images, k, record, b, column):
    tensor = load(record, b, column)
    if images is None:
        return (tensor,)
    reflection = load(images.table, images.code[k], PLANE_IMAGE.reflection)
    return (tensor * from_floats(1.0, 1.0, lane(reflection, 0) * lane(reflection, 1), 1.0),)


@symmetric_of.otherwise
def _symmetric_space(space, images, k, record, b, column):
    diagonal, off_diagonal = load(record, b, column), load(record, b, column + WIDTH)
    if images is None:
        return diagonal, off_diagonal
    return diagonal, load(images.table, images.code[k], SPACE_IMAGE.off_diagonal) * off_diagonal


@generic
def dyad(space, g):
    """g (x) g, the off-diagonal part twice, as `along` takes it."""


@dyad.of(Plane)
def _dyad_plane(space, g):
    g0, g1 = lane(g, 0), lane(g, 1)
    return (from_floats(g0 * g0, g1 * g1, 2.0 * g0 * g1, 0.0),)


@dyad.otherwise
def _dyad_space(space, g):
    direction = without_fourth(g)
    cross = _cross_first(direction) * _cross_second(direction)
    return direction * direction, cross + cross


@generic
def along(space, A, B, squares):
    """Lanes that add up to g . (A + B) g."""


@along.of(Plane)
def _along_plane(space, A, B, squares):
    return (A[0] + B[0]) * squares[0]


@along.otherwise
def _along_space(space, A, B, squares):
    return fused(A[1] + B[1], squares[1], (A[0] + B[0]) * squares[0])


@generic
def square(space, squares):
    """Lanes that add up to g . g."""


@square.of(Plane)
def _square_plane(space, squares):
    return from_floats(lane(squares[0], 0), lane(squares[0], 1), 0.0, 0.0)


@square.otherwise
def _square_space(space, squares):
    return squares[0]


@register_jitable
def free_lane(tensor):
    """The number that stands beside a symmetric tensor."""
    return lane(tensor[0], 3)
