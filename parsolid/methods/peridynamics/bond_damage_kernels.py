"""Breaking of bonds: which have failed or are crossed by a crack, what particles lose with them (see `bonds`).

Critical stretch: Silling and Askari, "A meshfree method based on the peridynamic model of solid mechanics", 2005, eqs
(23) to (27). Critical bond energy: Foster, Silling and Chen, "An energy based failure criterion for use with
peridynamic states", 2011, eq (11).
"""

import math
from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.methods.peridynamics.bonds import field_jump, place, reference_bond
from parsolid.numerics.dispatch import generic
from parsolid.pairs.lists import images_of, mutual
from parsolid.pairs.terms import kinematic_columns


class Stretch(NamedTuple):
    """A bond fails when (|y| - |xi|) / |xi| exceeds the lesser of its ends' `resistance` (n,) [1]."""

    resistance: np.ndarray


class Energy(NamedTuple):
    """A stretched bond fails when t . eta / 2 exceeds the lesser of its ends' `resistance` (n,) [J/m^6, in the plane
    J/m^4].

    eta is the change of the bond's vector and t = w [(M_a + M_b) xi + (C1_a + C1_b)(f_b - f_a)] its force density from
    the latest `record` (see `pairs`), without the second part where `control` is None; volume (n,) [m^3].
    """

    resistance: np.ndarray
    record: np.ndarray
    control: float | None
    volume: np.ndarray


class Patch(NamedTuple):
    """A flat crack: the parallelogram of two edges (3,) [m] at a corner (3,) [m]."""

    corner: np.ndarray
    first: np.ndarray
    second: np.ndarray


@register_jitable
def _squares(space, images, k, kinematics, a, b):
    """|y|^2 and |xi|^2 of the bond from a."""
    x = reference_bond(space, images, k, kinematics, a, b)
    u = field_jump(space, images, k, kinematics, kinematic_columns(space).position, a, b)
    y0, y1, y2 = x[0] + u[0], x[1] + u[1], x[2] + u[2]
    return y0 * y0 + y1 * y1 + y2 * y2, x[0] * x[0] + x[1] * x[1] + x[2] * x[2]


@generic(on="criterion")
def exceeds(space, criterion, weight, images, k, kinematics, a, b, limit):
    """True when the bond of weight w V_a V_b, as seen from a, is beyond the limit."""


@exceeds.of(Stretch)
def _exceeds_stretch(space, criterion, weight, images, k, kinematics, a, b, limit):
    y, x = _squares(space, images, k, kinematics, a, b)
    return y > (1.0 + limit) * (1.0 + limit) * x


@exceeds.otherwise
def _exceeds_energy(space, criterion, weight, images, k, kinematics, a, b, limit):
    y, x = _squares(space, images, k, kinematics, a, b)
    # the product of the volumes first, so that it rounds alike from both ends
    volumes = criterion.volume[a] * criterion.volume[b]
    return y > x and 0.5 * weight * _work(space, criterion, images, k, kinematics, a, b) > limit * volumes


@register_jitable
def _work(space, criterion, images, k, kinematics, a, b):
    """t . eta of a bond over its influence and volumes."""
    x = reference_bond(space, images, k, kinematics, a, b)
    u = field_jump(space, images, k, kinematics, kinematic_columns(space).position, a, b)
    work = _product(space, criterion.record, 0, images, k, a, b, u, x, False)
    if criterion.control is not None:
        f = field_jump(space, images, k, kinematics, kinematic_columns(space).field, a, b)
        work += _product(space, criterion.record, 1, images, k, a, b, u, f, True)
    return work


@register_jitable
def _product(space, record, number, images, k, a, b, left, right, vectors):
    """left . (A_a + A_b) right with matrix `number` of the records; A_b of an image is Q A_b Q for vectors, else Q A_b
    R.
    """
    d = space.dimension
    stride = 4 if d == 3 else 2
    result = 0.0
    for j in range(d):
        for i in range(d):
            column = (number * d + j) * stride + i
            other = record[b, column]
            if images is not None:
                row = images.table[images.code[k]]
                other *= row[i] * row[j if vectors else 4 + j]
            result += left[i] * (record[a, column] + other) * right[j]
    return result


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


@compiled(error_model="numpy")
def find_failed(space, pairs, kinematics, criterion, found):
    """List the intact bonds that are to break as rows (particle a, pair k) of found (capacity, 2) int64; returns how
    many.

    When they are more than the capacity, the first that fit are listed.
    """
    count, images = 0, images_of(pairs)
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            if pairs.weight[k] == 0.0:
                continue
            if fails(space, criterion, pairs.weight[k], images, k, kinematics, a, pairs.neighbour[k]):
                if count < len(found):
                    found[count, 0], found[count, 1] = a, k
                count += 1
    return count


@compiled
def cut(found, pairs):
    """Break the listed bonds."""
    for row in range(len(found)):
        pairs.weight[found[row, 1]] = 0.0


@compiled
def add_families(pairs, chosen, volume, family):
    """Add the volumes [m^3] of the neighbours that the chosen (n,) particles are still bonded to, to family (n,)."""
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            if pairs.weight[k] != 0.0:
                if chosen[a]:
                    family[a] += volume[b]
                if mutual(pairs) and chosen[b]:
                    family[b] += volume[a]


@compiled(error_model="numpy")
def find_crossing(space, pairs, kinematics, patch, found):
    """List, as `find_failed`, the intact bonds that a crack crosses; through a mirror plane the crack's image counts
    too.
    """
    count, images = 0, images_of(pairs)
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            if pairs.weight[k] == 0.0:
                continue
            b = pairs.neighbour[k]
            crosses = _crosses(space, images, k, kinematics, a, b, patch)
            if images is not None:
                crosses = crosses or _crosses(space, images, k, kinematics, b, a, patch)
            if crosses:
                if count < len(found):
                    found[count, 0], found[count, 1] = a, k
                count += 1
    return count


@register_jitable
def _dot(x, y):
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@register_jitable
def _cross(x, y):
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]


@register_jitable
def _beyond(part, slack, edge):
    """Whether a place at `part` of an edge is off it by more than slack [m]."""
    margin = slack / math.sqrt(_dot(edge, edge))
    return part < -margin or part > 1.0 + margin


@register_jitable
def _crosses(space, images, k, kinematics, a, b, patch):
    """Whether the bond from a cuts the patch."""
    A, B = place(space, None, k, kinematics, a), place(space, images, k, kinematics, b)
    # what lies on an edge, or on the plane, does so for both ends of the bond whatever their rounding
    slack = 1e-9 * (abs(B[0] - A[0]) + abs(B[1] - A[1]) + abs(B[2] - A[2]))
    normal = _cross(patch.first, patch.second)
    area = math.sqrt(_dot(normal, normal))
    from_corner = (A[0] - patch.corner[0], A[1] - patch.corner[1], A[2] - patch.corner[2])
    bond = (B[0] - A[0], B[1] - A[1], B[2] - A[2])
    before = _dot(from_corner, normal) / area
    after = before + _dot(bond, normal) / area
    if (before < -slack) == (after < -slack):
        return False
    part = before / (before - after)
    x = (from_corner[0] + part * bond[0], from_corner[1] + part * bond[1], from_corner[2] + part * bond[2])
    first = _dot(_cross(x, patch.second), normal) / (area * area)
    second = _dot(_cross(patch.first, x), normal) / (area * area)
    return not (_beyond(first, slack, patch.first) or _beyond(second, slack, patch.second))
