"""How four neighbouring particles are loaded from and stored to the arrays of updated-Lagrangian SPH."""

import math

from parsolid.methods.ulsph.terms import CentredCorrection
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.lanes import broadcast, load, store_first
from parsolid.numerics.layout import Plane, four_rows, load_six, store_rows
from parsolid.numerics.tensors import (
    I,
    SymmetricPlane,
    SymmetricSpace,
    contract,
    inverse_symmetric,
)

# of the moment, below the rounding of its sum
_NEGLIGIBLE = 1e-14
# of its norm, by how much B is carried on at most
_MOST_CHANGE = 0.25


@generic
def load_moment(space, sums, i):
    """sum m_a m_b k r (x) r of particles i..i+3, 33 = 0 in the plane."""


@load_moment.of(Plane)
def _plane_moment(space, sums, i):
    c = four_rows(sums, i, 4)
    return SymmetricPlane(c[0], c[1], broadcast(0.0), c[2])


@load_moment.otherwise
def _space_moment(space, sums, i):
    d, o = four_rows(sums, i, 12), four_rows(sums, i, 16)
    return SymmetricSpace(d[0], d[1], d[2], o[0], o[2], o[1])


@generic
def _with_unit(space, A):
    """The moment with 33 = 1 in the plane."""


@_with_unit.of(Plane)
def _plane_with_unit(space, A):
    return SymmetricPlane(A[0], A[1], broadcast(1.0), A[3])


@_with_unit.otherwise
def _space_with_unit(space, A):
    return A


@generic(on="correction")
def bounded_inverse(space, correction, moment):
    """B = A^-1 of the dimensionless moment A, scaled so that its norm is at most `most`; 33 = 1 in the plane.

    Scaled, not replaced: sigma B A stays symmetric, so that angular momentum is kept where neighbours are few, and B
    stays bounded where they are in a line or a plane.
    """


@bounded_inverse.of(None)
def _uncorrected(space, correction, moment):
    return _identity(_with_unit(space, moment))


@bounded_inverse.otherwise
def _corrected(space, correction, moment):
    # of neighbours in a plane, or none, the inverse is a large number and not 1/0
    A = _with_unit(space, moment) + _NEGLIGIBLE * I
    B = inverse_symmetric(A)
    return min(correction.most / math.sqrt(contract(B, B)), 1.0) * B


@generic(on="correction")
def carried_on(correction, space, last, i, B, after, since):
    """B for forces that act a time `after` [s] after its own, those of particles i..i+3 in `last` a time `since`
    before it.
    """


@carried_on.of(CentredCorrection)
def _extrapolated(correction, space, last, i, B, after, since):
    change = B - load_correction(space, last, i)
    # neighbours that come or go change it at once
    most = _MOST_CHANGE * math.sqrt(contract(B, B) / max(contract(change, change), 1e-300))
    return B + min(after / max(since, 1e-300), most) * change


@carried_on.otherwise
def _as_it_was(correction, space, last, i, B, after, since):
    return B


@generic
def _identity(A):
    """1, as a symmetric tensor of lanes."""


@_identity.of(SymmetricPlane)
def _plane_identity(A):
    one, zero = broadcast(1.0), broadcast(0.0)
    return SymmetricPlane(one, one, one, zero)


@_identity.of(SymmetricSpace)
def _space_identity(A):
    one, zero = broadcast(1.0), broadcast(0.0)
    return SymmetricSpace(one, one, one, zero, zero, zero)


@generic
def load_correction(space, correction, i):
    """B of particles i..i+3, 33 = 1 in the plane."""


@load_correction.of(Plane)
def _load_plane_correction(space, correction, i):
    return SymmetricPlane(load(correction, 0, i), load(correction, 1, i), broadcast(1.0), load(correction, 2, i))


@load_correction.otherwise
def _load_space_correction(space, correction, i):
    return load_six(correction, 0, i)


@generic
def store_correction(space, correction, i, B, count):
    """B of the first `count` of particles i..i+3."""


@store_correction.of(Plane)
def _store_plane_correction(space, correction, i, B, count):
    store_first(correction, 0, i, B[0], count)
    store_first(correction, 1, i, B[1], count)
    store_first(correction, 2, i, B[3], count)


@store_correction.otherwise
def _store_space_correction(space, correction, i, B, count):
    store_first(correction, 0, i, B[0], count)
    store_first(correction, 1, i, B[1], count)
    store_first(correction, 2, i, B[2], count)
    store_first(correction, 3, i, B[3], count)
    store_first(correction, 4, i, B[4], count)
    store_first(correction, 5, i, B[5], count)


@generic(on="speed")
def _speed_in_record(speed, record, i):
    """What the plane's records of particles i..i+3 hold as the speed of sound."""


@_speed_in_record.of(None)
def _speed_as_it_is(speed, record, i):
    # those beyond the law's last may be ghosts of another law
    return four_rows(record, i, 4)[3]


@_speed_in_record.otherwise
def _new_speed(speed, record, i):
    return speed


@generic
def store_stress_record(space, record, i, P, density, rate, temperature, speed):
    """P B of particles i..i+3 with rho, v^p and T into their records; up to three beyond are written as well.

    speed: c, which the plane's records hold too; None of a law whose speed of sound does not change.
    """


@store_stress_record.of(Plane)
def _store_plane_record(space, record, i, P, density, rate, temperature, speed):
    store_rows(record, i, 0, P[0], P[2], P[1], P[3])
    store_rows(record, i, 4, density, rate, temperature, _speed_in_record(speed, record, i))


@store_stress_record.otherwise
def _store_space_record(space, record, i, P, density, rate, temperature, speed):
    store_rows(record, i, 0, P[0], P[3], P[6], density)
    store_rows(record, i, 4, P[1], P[4], P[7], rate)
    store_rows(record, i, 8, P[2], P[5], P[8], temperature)


@none_without("array")
def load_vector(array, i, space):
    """Components of a vector of particles i..i+3."""
    return _components(space, array, i)


@generic
def _components(space, array, i):
    """As many as the space has."""


@_components.of(Plane)
def _two_components(space, array, i):
    return load(array, 0, i), load(array, 1, i)


@_components.otherwise
def _three_components(space, array, i):
    return load(array, 0, i), load(array, 1, i), load(array, 2, i)


@none_without("array")
def store_vector(array, i, values, count):
    """Components of a vector of the first `count` of particles i..i+3."""
    for k in range(len(values)):
        store_first(array, k, i, values[k], count)
    return values


@none_without("array")
def load_number(array, i):
    """A number of particles i..i+3."""
    return load(array, 0, i)


@none_without("array")
def store_number(array, i, value, count):
    """A number of the first `count` of particles i..i+3."""
    store_first(array, 0, i, value, count)
    return value
