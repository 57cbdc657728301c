"""Contact and artificial viscosity of a pair of particles, by type; pairs of one body have the contact None."""

from decomposition.deferred import register_jitable
from parsolid.methods.ulsph.terms import ArtificialViscosity, CompressionOnly
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import lane
from parsolid.pairs.primitives import dot, stress_of, sum_times


@register_jitable
def _pressed(space, images, k, record, a, b, r):
    """Whether the stresses of both push them apart."""
    own = stress_of(space, None, 0, record, a, 0)
    return dot(space, sum_times(space, own, stress_of(space, images, k, record, b, 0), r), r) < 0.0


@generic(on="contact")
def meet(space, contact, images, k, record, a, b, dv, r):
    """Whether the motion of each strains the other."""


@meet.of(CompressionOnly)
def _approach_or_press(space, contact, images, k, record, a, b, dv, r):
    return dot(space, dv, r) < 0.0 or _pressed(space, images, k, record, a, b, r)


@meet.otherwise
def _always_meet(space, contact, images, k, record, a, b, dv, r):
    return True


@generic(on="contact")
def act(space, contact, images, k, record, a, b, r):
    """Whether the stresses of both act on both."""


@act.of(CompressionOnly)
def _press(space, contact, images, k, record, a, b, r):
    return _pressed(space, images, k, record, a, b, r)


@act.otherwise
def _always_act(space, contact, images, k, record, a, b, r):
    return True


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
