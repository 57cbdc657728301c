"""A step of a hypoelastic deviator in Jaumann's rate, S' = 2 mu (dev D - v^p N) + W S - S W with N = S/|S|.

All of second order: an exactly orthogonal rotation (`tensors.spin_rotation`), the strain half before and half after it,
and a direction of flow that is that of the middle of the step.
"""

from parsolid.kernels import inlined
from parsolid.tensors import (
    add_spherical,
    combine_symmetric,
    congruence,
    contract_symmetric,
    plus_symmetric,
    symmetric_part,
    times_symmetric,
)


@inlined
def deviatoric_strain(turn, velocity_gradient, step):
    """dev D dt of a step [s], the first half of it turned by the rotation of the step; symmetric."""
    D = symmetric_part(velocity_gradient)
    half = times_symmetric(0.5 * step, add_spherical(D, -(D[0] + D[1] + D[2]) / 3.0))
    return plus_symmetric(congruence(turn, half), half)


@inlined
def returned_deviator(turned, trial, tau, tau1, elastic_flow):
    """S [Pa] at the end of a step whose |S| went from tau to tau1.

    turned: S of its start, turned; trial: with 2 mu times the strain; elastic_flow: mu v^p dt [Pa]. With the flow along
    the mean of both ends S is along trial - a turned, a = mu v^p dt/|S|; along trial alone, as a radial return, the
    direction is of first order.
    """
    mean = 0.5 * (tau + tau1)
    # with more flow than stress all is along the last strain
    ratio = elastic_flow / (max(elastic_flow, mean) + 1e-300)
    along = combine_symmetric(1.0, trial, -ratio, turned)
    norm = contract_symmetric(along, along) ** 0.5
    return times_symmetric(tau1 / (norm + 1e-300) if norm > 0.0 else 0.0 * norm, along)
