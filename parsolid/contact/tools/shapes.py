"""Signed distances of rigid shapes: positive outside; in the frame of the tool, whose origin is its place.

Places are three numbers in any dimension, those beyond it zero: a disc is a ball at Z = 0.
"""

import math
from typing import NamedTuple

from numba.extending import register_jitable

from parsolid.contact.tools.surface import NO_SURFACE, Surface, surface_distance

PLANE, BALL, CYLINDER, BOX, MESH = range(5)
Vector = tuple[float, float, float]


class Shape(NamedTuple):
    """A shape of one of these kinds, of one type for all, so that kernels are compiled once.

    axis: outward normal of a plane through the origin, with the half-space below it; direction of a cylinder. size [m]:
    radius of a ball; radius and half the length of a cylinder, which may be inf; half widths of a box, infinite along
    the axes that the scene lacks.
    """

    kind: int
    axis: Vector = (0.0, 0.0, 0.0)
    size: Vector = (0.0, 0.0, 0.0)
    surface: Surface = NO_SURFACE


@register_jitable
def distance(shape, x, y, z, reach):
    """(signed distance [m], its gradient (3 numbers)) at a place [m].

    A distance of more than `reach` may be replaced by any number above `reach`.
    """
    if shape.kind == MESH:
        return surface_distance(shape.surface, x, y, z, reach)
    return plain_distance(shape.kind, shape.axis, shape.size, x, y, z)


@register_jitable
def plain_distance(kind, axis, size, x, y, z):
    """`distance` of the kinds without a mesh."""
    p, q, r = axis
    a, b, c = size
    if kind == PLANE:
        return p * x + q * y + r * z, p, q, r
    if kind == BALL:
        away = math.sqrt(x * x + y * y + z * z)
        if away == 0.0:
            return -a, 1.0, 0.0, 0.0
        return away - a, x / away, y / away, z / away
    if kind == CYLINDER:
        return _cylinder(a, b, p, q, r, x, y, z)
    signs = math.copysign(1.0, x), math.copysign(1.0, y), math.copysign(1.0, z)
    return _box(abs(x) - a, abs(y) - b, abs(z) - c, signs[0], signs[1], signs[2])


@register_jitable
def _cylinder(radius, half, p, q, r, x, y, z):
    along = p * x + q * y + r * z
    rx, ry, rz = x - along * p, y - along * q, z - along * r
    away = math.sqrt(rx * rx + ry * ry + rz * rz)
    if away > 0.0:
        rx, ry, rz = rx / away, ry / away, rz / away
    # beyond the mantle, beyond the nearer end
    side, end = away - radius, abs(along) - half
    sign = math.copysign(1.0, along)
    if side > 0.0 and end > 0.0:
        far = math.sqrt(side * side + end * end)
        u, v = side / far, sign * end / far
        return far, u * rx + v * p, u * ry + v * q, u * rz + v * r
    if side >= end:
        return side, rx, ry, rz
    return end, sign * p, sign * q, sign * r


@register_jitable
def _box(a, b, c, i, j, k):
    """By the distances a, b, c beyond a side along each axis, and the signs of the outward directions there."""
    if a <= 0.0 and b <= 0.0 and c <= 0.0:
        if a >= b and a >= c:
            return a, i, 0.0, 0.0
        if b >= c:
            return b, 0.0, j, 0.0
        return c, 0.0, 0.0, k
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    far = math.sqrt(a * a + b * b + c * c)
    return far, i * a / far, j * b / far, k * c / far
