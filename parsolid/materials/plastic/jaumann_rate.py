"""The elastic step of a hypoelastic deviator in Jaumann's rate."""

from parsolid.numerics.polar import congruence, symmetric_part
from parsolid.numerics.tensors import I, contract, formula, trace


@formula
def jaumann_trial(S, velocity_gradient, step, shear_modulus):
    """S [Pa] after an elastic step [s] of S' = 2 mu dev D + W S - S W, for a velocity gradient D + W [1/s] of its middle.

    The rotation is that of Cayley, exactly orthogonal, between two halves of the strain: of second order, and |S| is kept
    where D = 0. S is symmetric, velocity_gradient general.
    """
    D = symmetric_part(velocity_gradient)
    half = (shear_modulus * step) * (D + (-1.0 / 3.0 * trace(D)) * I)
    A = (0.25 * step) * (velocity_gradient - velocity_gradient.T)
    # A^2 = a a^T - a.a 1 of the axial vector a
    turn = I + (2.0 / (1.0 + 0.5 * contract(A, A))) * (A + A @ A)
    return congruence(turn, S + half) + half
