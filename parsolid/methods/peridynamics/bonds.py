"""Bonds of a scalar-weighted pair list: the vector of a bond in the reference and its change (see `pairs` for the
arrays).

A weight of 0.0 is a broken bond. Vectors have three components, the third 0 in the plane. The vectors of a bond seen
from its two ends differ by their sign alone, to the bit, so that two ranks decide alike about a bond across their
border. That does not hold for a bond with a mirror image; whoever decides about one looks at both, (a, b') and (b, a').
"""

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.layout import Plane
from parsolid.pairs.terms import kinematic_columns


@generic
def place(space, images, k, kinematics, b):
    """X of particle b, or of its image in pair k [m]; images None for the particle itself."""


@place.of(Plane)
def _place_in_plane(space, images, k, kinematics, b):
    X = kinematic_columns(space).reference
    x, y = kinematics[b, X], kinematics[b, X + 1]
    if images is not None:
        row = images.table[images.code[k]]
        x, y = row[4] * x + row[6], row[5] * y + row[7]
    return x, y, 0.0


@place.otherwise
def _place_in_space(space, images, k, kinematics, b):
    X = kinematic_columns(space).reference
    x, y, z = kinematics[b, X], kinematics[b, X + 1], kinematics[b, X + 2]
    if images is not None:
        row = images.table[images.code[k]]
        x, y, z = row[4] * x + row[8], row[5] * y + row[9], row[6] * z + row[10]
    return x, y, z


@register_jitable
def reference_bond(space, images, k, kinematics, a, b):
    """xi = X_b - X_a [m], with b the particle or its image in pair k."""
    A, B = place(space, None, k, kinematics, a), place(space, images, k, kinematics, b)
    return B[0] - A[0], B[1] - A[1], B[2] - A[2]


@generic
def field_jump(space, images, k, kinematics, column, a, b):
    """v_b - v_a of the vector field in columns `column`... of the kinematics, with b the particle or its image in pair
    k.
    """


@field_jump.of(Plane)
def _jump_in_plane(space, images, k, kinematics, column, a, b):
    x, y = kinematics[b, column], kinematics[b, column + 1]
    if images is not None:
        row = images.table[images.code[k]]
        x, y = row[0] * x, row[1] * y
    return x - kinematics[a, column], y - kinematics[a, column + 1], 0.0


@field_jump.otherwise
def _jump_in_space(space, images, k, kinematics, column, a, b):
    x, y, z = kinematics[b, column], kinematics[b, column + 1], kinematics[b, column + 2]
    if images is not None:
        row = images.table[images.code[k]]
        x, y, z = row[0] * x, row[1] * y, row[2] * z
    return x - kinematics[a, column], y - kinematics[a, column + 1], z - kinematics[a, column + 2]
