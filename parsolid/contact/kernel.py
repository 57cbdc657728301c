"""The quintic B-spline M6, the kernel of contact, and the colour of a flat lattice of particles.

W = N R^-d [(1 - q)^5 - 6 (2/3 - q)^5 + 15 (1/3 - q)^5], q = r/R, each bracket cut at 0 (Schoenberg 1946).
"""

import math
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numba.extending import register_jitable

from parsolid.kernels import kernel

_POINTS = 96


@register_jitable
def _fourth(x):
    return (x * x) * (x * x)


@register_jitable
def shape(q: Any) -> Any:
    """W over N R^-d at q = r/R."""
    third, second, first = max(0.0, 1.0 - q), max(0.0, 2.0 / 3.0 - q), max(0.0, 1.0 / 3.0 - q)
    return _fourth(third) * third - 6.0 * (_fourth(second) * second) + 15.0 * (_fourth(first) * first)


@register_jitable
def slope(q: Any) -> Any:
    """dW/dr over N R^-(d + 1) at q = r/R."""
    third, second, first = max(0.0, 1.0 - q), max(0.0, 2.0 / 3.0 - q), max(0.0, 1.0 / 3.0 - q)
    return -5.0 * (_fourth(third) - 6.0 * _fourth(second) + 15.0 * _fourth(first))


@kernel
def shapes_and_slopes(q):
    """`shape` and `slope` of numbers (n,)."""
    shapes, slopes = np.empty(len(q)), np.empty(len(q))
    for i in range(len(q)):
        shapes[i], slopes[i] = shape(q[i]), slope(q[i])
    return shapes, slopes


def norm(dimension: int, radius: float) -> float:
    """N R^-d [1/m^d]; N is 7 3^7/(478 pi) in the plane, 3^7/(40 pi) in space."""
    exact = {1: 243.0 / 40.0, 2: 7.0 * 3.0**7 / (478.0 * math.pi), 3: 3.0**7 / (40.0 * math.pi)}
    return exact[dimension] / radius**dimension


# nodes and weights of Gauss's rule on -1..1
_gauss = cache(np.polynomial.legendre.leggauss)


def over_planes(z: float, radius: float, dimension: int) -> tuple[float, float]:
    """W integrated over the plane (in 2-D the line) at distance z from its centre [1/m], and its derivative there
    [1/m^2], by Gauss's rule on each piece of the spline."""
    z = abs(z)
    if z >= radius:
        return 0.0, 0.0
    knots = [math.sqrt(max(0.0, (radius * k / 3.0) ** 2 - z * z)) for k in (0, 1, 2, 3)]
    nodes, weights = _gauss(_POINTS)
    value = derivative = 0.0
    for low, high in zip([0.0, *knots[1:]], knots[1:]):
        if high <= low:
            continue
        t = 0.5 * (high + low) + 0.5 * (high - low) * nodes
        r = np.sqrt(z * z + t * t)
        measure = 0.5 * (high - low) * weights * (2.0 if dimension == 2 else 2.0 * math.pi * t)
        shapes, slopes = shapes_and_slopes(np.clip(r / radius, 0.0, 1.0))
        value += float(measure @ shapes)
        derivative += float(measure @ (slopes * z / (radius * r)))
    factor = norm(dimension, radius)
    return factor * value, factor * derivative


@lru_cache(maxsize=4096)
def lattice_colour(depth: float, spacing: float, nodal: bool, radius: float, dimension: int) -> tuple[float, float]:
    """Mean over the face of a flat lattice's colour seen from `depth` [m] outside its face, and minus its slope
    [1/m]; nodal: whether the outer particles lie on the face, with half their volume."""
    colour = steepness = 0.0
    count = math.ceil((radius + abs(depth)) / spacing) + 1
    for k in range(count):
        weight = 0.5 if nodal and k == 0 else 1.0
        z = depth + (k if nodal else k + 0.5) * spacing
        value, derivative = over_planes(z, radius, dimension)
        colour += weight * spacing * value
        steepness -= weight * spacing * derivative * (1.0 if z >= 0.0 else -1.0)
    return colour, steepness
