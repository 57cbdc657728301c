"""Signed distances of rigid shapes: positive outside; in the frame of the tool, whose origin is its place.

A shape is a NamedTuple; places are three numbers in any dimension, those beyond it zero: a disc is a ball at Z = 0.
"""

import math
from typing import NamedTuple

from numba.extending import register_jitable

from parsolid.materials.law_functions import law_function


class HalfSpace(NamedTuple):
    """The half-space below a plane through the origin; (x, y, z): unit outward normal."""

    x: float
    y: float
    z: float


class Ball(NamedTuple):
    """A ball of a radius [m]; a disc in 2-D."""

    radius: float


class Rod(NamedTuple):
    """A cylinder of a radius and half a length [m], which may be inf; (x, y, z): unit vector along the axis."""

    radius: float
    half: float
    x: float
    y: float
    z: float


class Block(NamedTuple):
    """A box of half widths [m] along the axes of the tool, infinite along those that the scene lacks."""

    x: float
    y: float
    z: float


@law_function
def distance(shape, x, y, z, reach):
    """(signed distance [m], its gradient (3 numbers)) at a place [m].

    A distance of more than `reach` may be replaced by any number above `reach`.
    """


@distance.of(HalfSpace)
def _half_space(shape, x, y, z, reach):
    return shape.x * x + shape.y * y + shape.z * z, shape.x, shape.y, shape.z


@distance.of(Ball)
def _ball(shape, x, y, z, reach):
    away = math.sqrt(x * x + y * y + z * z)
    if away == 0.0:
        return -shape.radius, 1.0, 0.0, 0.0
    return away - shape.radius, x / away, y / away, z / away


@distance.of(Rod)
def _rod(shape, x, y, z, reach):
    along = shape.x * x + shape.y * y + shape.z * z
    rx, ry, rz = x - along * shape.x, y - along * shape.y, z - along * shape.z
    away = math.sqrt(rx * rx + ry * ry + rz * rz)
    if away > 0.0:
        rx, ry, rz = rx / away, ry / away, rz / away
    # beyond the mantle, beyond the nearer end
    side, end = away - shape.radius, abs(along) - shape.half
    sign = math.copysign(1.0, along)
    if side > 0.0 and end > 0.0:
        far = math.sqrt(side * side + end * end)
        p, q = side / far, sign * end / far
        return far, p * rx + q * shape.x, p * ry + q * shape.y, p * rz + q * shape.z
    if side >= end:
        return side, rx, ry, rz
    return end, sign * shape.x, sign * shape.y, sign * shape.z


@register_jitable
def _beyond(place, half):
    """Distance beyond a side, and the sign of its outward direction."""
    return abs(place) - half, math.copysign(1.0, place)


@distance.of(Block)
def _block(shape, x, y, z, reach):
    a, i = _beyond(x, shape.x)
    b, j = _beyond(y, shape.y)
    c, k = _beyond(z, shape.z)
    if a <= 0.0 and b <= 0.0 and c <= 0.0:
        if a >= b and a >= c:
            return a, i, 0.0, 0.0
        if b >= c:
            return b, 0.0, j, 0.0
        return c, 0.0, 0.0, k
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    far = math.sqrt(a * a + b * b + c * c)
    return far, i * a / far, j * b / far, k * c / far
