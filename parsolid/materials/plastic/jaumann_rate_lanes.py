"""A step of a hypoelastic deviator in Jaumann's rate, S' = 2 mu (dev D - v^p N) + W S - S W with N = S/|S|.

All of second order: exactly orthogonal rotation, the strain half before and half after it, and a direction of flow that
is that of the middle of the step.
"""

import math

from decomposition.deferred import register_jitable
from parsolid.numerics.elementary import choose
from parsolid.numerics.polar import congruence, symmetric_part
from parsolid.numerics.tensors import I, contract, formula, trace


@formula
def jaumann_turn(velocity_gradient, step):
    """Cayley's rotation of a spin W over a step [s], (1 - W dt/2)^-1 (1 + W dt/2), of a general velocity gradient D + W
    [1/s].
    """
    A = (0.25 * step) * (velocity_gradient - velocity_gradient.T)
    # A^2 = a a^T - a.a 1 of the axial vector a
    return I + (2.0 / (1.0 + 0.5 * contract(A, A))) * (A + A @ A)


@formula
def elastic_increment(turn, velocity_gradient, step, shear_modulus):
    """What 2 mu dev D adds to S [Pa] in a step [s], the first half of it turned; symmetric."""
    D = symmetric_part(velocity_gradient)
    half = (shear_modulus * step) * (D + (-1.0 / 3.0 * trace(D)) * I)
    return congruence(turn, half) + half


@formula
def jaumann_trial(S, velocity_gradient, step, shear_modulus):
    """S [Pa] after a step [s] without flow."""
    turn = jaumann_turn(velocity_gradient, step)
    return congruence(turn, S) + elastic_increment(turn, velocity_gradient, step, shear_modulus)


@register_jitable
def returned_deviator(rotated, trial, tau, tau1, elastic_flow):
    """S [Pa] at the end of a step whose |S| went from tau to tau1.

    rotated: the S of its start, turned; trial: with the elastic increment; elastic_flow: mu v^p dt [Pa]. With the flow
    along the mean of both ends S is along trial - a rotated, a = mu v^p dt/|S|; along trial alone, as a radial return,
    the direction is of first order.
    """
    mean = 0.5 * (tau + tau1)
    # with more flow than stress all is along the last strain
    ratio = elastic_flow / (choose(elastic_flow - mean, elastic_flow, mean) + 1e-300)
    along = trial - ratio * rotated
    norm = math.sqrt(contract(along, along))
    return choose(norm, tau1 / (norm + 1e-300), 0.0 * norm) * along
