"""Breaking of bonds: which have failed, what the particles lose with them, damage (see `bonds` for conventions).

Critical stretch: Silling and Askari, "A meshfree method based on the peridynamic model of solid mechanics", 2005, eqs (23)
to (27). Critical bond energy: Foster, Silling and Chen, "An energy based failure criterion for use with peridynamic
states", 2011, eq (11).
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload, register_jitable

from parsolid.kernels.bonds import displacement_column, field_jump, place, reference_bond
from parsolid.kernels.types import is_instance


class Stretch(NamedTuple):
    """A bond fails when (|y| - |xi|) / |xi| exceeds the lesser of its ends' `resistance` (n,) [1]."""

    resistance: np.ndarray


class Intact(NamedTuple):
    """What particles have left: shape (n, d, d) sum of weight xi (x) xi; family (n,) [m^3] volume of the neighbours bonded to."""

    shape: np.ndarray
    family: np.ndarray


@register_jitable
def _squares(space, images, k, kinematics, a, b):
    """|y|^2 and |xi|^2 of the bond from a."""
    x = reference_bond(space, images, k, kinematics, a, b)
    u = field_jump(space, images, k, kinematics, displacement_column(space), a, b)
    y0, y1, y2 = x[0] + u[0], x[1] + u[1], x[2] + u[2]
    return y0 * y0 + y1 * y1 + y2 * y2, x[0] * x[0] + x[1] * x[1] + x[2] * x[2]


def exceeds(space, criterion, weight, images, k, kinematics, a, b, limit):
    """True when the bond of weight `weight` [see `pairs`], as seen from a, is beyond the limit."""
    raise NotImplementedError


@overload(exceeds)
def _exceeds(space, criterion, weight, images, k, kinematics, a, b, limit):
    if is_instance(criterion, Stretch):

        def by_stretch(space, criterion, weight, images, k, kinematics, a, b, limit):
            y, x = _squares(space, images, k, kinematics, a, b)
            return y > (1.0 + limit) * (1.0 + limit) * x

        return by_stretch


@register_jitable
def fails(space, criterion, weight, images, k, kinematics, a, b):
    """True when the bond is to break; decided alike from both ends."""
    limit = min(criterion.resistance[a], criterion.resistance[b])
    # a dead particle
    if limit < 0.0:
        return True
    failed = exceeds(space, criterion, weight, images, k, kinematics, a, b, limit)
    if images is not None:
        failed = failed or exceeds(space, criterion, weight, images, k, kinematics, b, a, limit)
    return failed


@njit(cache=True, error_model="numpy")
def find_failed(space, pairs, images, criterion, kinematics, found):
    """List the intact bonds that are to break as rows (particle a, pair k) of found (capacity, 2) int64; returns how many.

    When they are more than the capacity, the first that fit are listed.
    """
    count = 0
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            if pairs.weight[k] == 0.0:
                continue
            if fails(space, criterion, pairs.weight[k], images, k, kinematics, a, pairs.neighbour[k]):
                if count < len(found):
                    found[count, 0], found[count, 1] = a, k
                count += 1
    return count


@njit(cache=True, error_model="numpy")
def subtract_gradients(space, found, pairs, images, both, kinematics, column, gradient):
    """Take the listed bonds out of sums made by `add_gradients` of the field in columns `column`...; before they are cut."""
    d = 2 if gradient.shape[1] == 4 else 3
    stride = gradient.shape[1] // d
    for row in range(len(found)):
        a, k = found[row]
        b = pairs.neighbour[k]
        x = reference_bond(space, images, k, kinematics, a, b)
        v = field_jump(space, images, k, kinematics, column, a, b)
        for j in range(d):
            for i in range(d):
                term = pairs.weight[k] * x[j] * v[i]
                gradient[a, stride * j + i] -= term
                if both is not None:
                    gradient[b, stride * j + i] -= term


@njit(cache=True, error_model="numpy")
def cut(space, found, pairs, images, both, kinematics, volume, intact):
    """Break the listed bonds: their weight becomes 0 and `intact` (see `Intact`) loses their part; volume (n,) [m^3]."""
    d = intact.shape.shape[1]
    for row in range(len(found)):
        a, k = found[row]
        b = pairs.neighbour[k]
        x = reference_bond(space, images, k, kinematics, a, b)
        intact.family[a] -= volume[b]
        if both is not None:
            intact.family[b] -= volume[a]
        for i in range(d):
            for j in range(d):
                term = pairs.weight[k] * x[i] * x[j]
                intact.shape[a, i, j] -= term
                if both is not None:
                    intact.shape[b, i, j] -= term
        pairs.weight[k] = 0.0


@njit(cache=True, error_model="numpy")
def add_families(space, pairs, images, both, kinematics, volume, intact):
    """Add what the intact bonds of a list give to `intact`."""
    d = intact.shape.shape[1]
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            if pairs.weight[k] == 0.0:
                continue
            b = pairs.neighbour[k]
            x = reference_bond(space, images, k, kinematics, a, b)
            intact.family[a] += volume[b]
            if both is not None:
                intact.family[b] += volume[a]
            for i in range(d):
                for j in range(d):
                    term = pairs.weight[k] * x[i] * x[j]
                    intact.shape[a, i, j] += term
                    if both is not None:
                        intact.shape[b, i, j] += term


@njit(cache=True, error_model="numpy")
def find_crossing(space, pairs, images, kinematics, axis, offset, lower, upper, found):
    """List, as `find_failed`, the intact bonds that cross the plane X[axis] = offset within the box lower, upper (3,) [m]."""
    count = 0
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            if pairs.weight[k] == 0.0:
                continue
            b = pairs.neighbour[k]
            crosses = _crosses(space, images, k, kinematics, a, b, axis, offset, lower, upper)
            if images is not None:
                crosses = crosses or _crosses(space, images, k, kinematics, b, a, axis, offset, lower, upper)
            if crosses:
                if count < len(found):
                    found[count, 0], found[count, 1] = a, k
                count += 1
    return count


@register_jitable
def _crosses(space, images, k, kinematics, a, b, axis, offset, lower, upper):
    A, B = place(space, None, k, kinematics, a), place(space, images, k, kinematics, b)
    # what lies on an edge of the box, or on the plane, does so for both ends of the bond whatever their rounding
    slack = 1e-9 * (abs(B[0] - A[0]) + abs(B[1] - A[1]) + abs(B[2] - A[2]))
    before, after = A[axis] - offset + slack, B[axis] - offset + slack
    if (before < 0.0) == (after < 0.0):
        return False
    part = before / (before - after)
    for i in range(3):
        crossing = A[i] + part * (B[i] - A[i])
        if i != axis and not lower[i] - slack <= crossing <= upper[i] + slack:
            return False
    return True
