"""Contact and artificial viscosity of a pair of particles, by type."""

from numba.extending import register_jitable

from parsolid.methods.ulsph.terms import ArtificialViscosity, CompressionOnly, Welded
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import lane
from parsolid.pairs.primitives import dot, stress_of, sum_times

APART, SAME_BODY, IN_CONTACT = 0.0, 1.0, 2.0


@register_jitable
def _pressed(space, images, k, record, a, b, r):
    """Whether the mean stress of both pushes them apart."""
    own = stress_of(space, None, 0, record, a, 0)
    return dot(space, sum_times(space, own, stress_of(space, images, k, record, b, 0), r), r) < 0.0


@generic(on="contact")
def contact_of_rates(space, contact, images, k, record, a, b, dv, r):
    """APART where the pair counts for nothing, IN_CONTACT where the stress of each drives the other."""


@contact_of_rates.of(None)
def _one_body(space, contact, images, k, record, a, b, dv, r):
    return SAME_BODY


@contact_of_rates.of(Welded)
def _welded(space, contact, images, k, record, a, b, dv, r):
    return SAME_BODY if contact.body[0, a] == contact.body[0, b] else IN_CONTACT


@contact_of_rates.of(CompressionOnly)
def _touching(space, contact, images, k, record, a, b, dv, r):
    if contact.body[0, a] == contact.body[0, b]:
        return SAME_BODY
    if dot(space, dv, r) < 0.0 or _pressed(space, images, k, record, a, b, r):
        return IN_CONTACT
    return APART


@generic(on="contact")
def contact_of_forces(space, contact, images, k, record, a, b, r):
    """As `contact_of_rates`, for the forces of the stresses."""


@contact_of_forces.of(None)
def _force_in_body(space, contact, images, k, record, a, b, r):
    return SAME_BODY


@contact_of_forces.of(Welded)
def _welded_force(space, contact, images, k, record, a, b, r):
    return SAME_BODY if contact.body[0, a] == contact.body[0, b] else IN_CONTACT


@contact_of_forces.of(CompressionOnly)
def _contact_force(space, contact, images, k, record, a, b, r):
    if contact.body[0, a] == contact.body[0, b]:
        return SAME_BODY
    return IN_CONTACT if _pressed(space, images, k, record, a, b, r) else APART


@generic(on="viscosity")
def viscous_pressure(space, viscosity, length, mean, dv, r, square):
    """Pi_ab [Pa m^6/kg^2] of a pair with the mean of both `numbers`, 0 in separation."""


@viscous_pressure.of(None)
def _inviscid(space, viscosity, length, mean, dv, r, square):
    return 0.0


@viscous_pressure.of(ArtificialViscosity)
def _monaghan(space, viscosity, length, mean, dv, r, square):
    approach = min(dot(space, dv, r), 0.0)
    mu = length * approach / (square + viscosity.softening * length * length)
    return mu * (viscosity.quadratic * mu - viscosity.linear * lane(mean, 3)) / lane(mean, 0)
