"""Maxwell branches with the internal variable A_alpha = C_v,alpha^{-1} (Lee et al., eqs (20), (26), (28), (56), (A.1)).

A branch of the modulus mu_alpha adds mu_alpha/2 [C : A - 3 - ln(J^2 det A)] to the energy, C = F^T F. A relaxes towards
C^{-1} with the time tau_alpha. Over a step with x = dt/tau, C^{-1} is taken as linear in time:

    A_1 = e^{-x} A_0 + (phi - e^{-x}) C_0^{-1} + (1 - phi) C_1^{-1},   phi = (1 - e^{-x})/x,

which is second order, unlike (78) that freezes C^{-1} over the step. All branches of a law together act by
branch_sum = sum mu_alpha A_alpha, symmetric, and by their `total_modulus`, sum mu_alpha [Pa]. Symmetric tensors have
six components (`parsolid.tensors`).
"""

import math

from parsolid.elementary import log
from parsolid.kernels import inlined
from parsolid.materials.law_functions import law_function
from parsolid.tensors import (
    combine,
    combine_symmetric,
    contract_symmetric,
    determinant_symmetric,
    general,
    gram,
    inverse_symmetric,
    matmul,
)


@law_function
def total_modulus(branch_moduli):
    """sum mu_alpha [Pa] of the moduli of a law's branches, 0 without (None)."""


@total_modulus.of(None)
def _without_branches(branch_moduli):
    return 0.0


@total_modulus.of(tuple)
def _sum_of_moduli(branch_moduli):
    result = 0.0
    for modulus in branch_moduli:
        result += modulus
    return result


@inlined
def branch_stress(total_modulus, branch_sum, F, H, J):
    """First Piola-Kirchhoff stress [Pa] of all branches: F branch_sum - total_modulus/J H (A.1)."""
    # divisions by the same number are made once
    r = 1.0 / J
    return combine(1.0, matmul(F, general(branch_sum)), -total_modulus * r, H)


@inlined
def branch_waves(total_modulus, branch_sum, H, J):
    """The part of branches in the pressure wave tensor [Pa] (56): branch_sum + total_modulus/J^2 H^T H.

    The shear wave tensor is increased by branch_sum alone.
    """
    r = 1.0 / J
    return combine_symmetric(1.0, branch_sum, total_modulus * (r * r), gram(H))


@inlined
def relaxed(weights, A, old_inverse, new_inverse):
    """A after a step with the `relaxation_weights` of it, from C^{-1} at its start and its end."""
    return combine_symmetric(weights[0], A, 1.0, combine_symmetric(weights[1], old_inverse, weights[2], new_inverse))


@inlined
def relax(modulus, relaxation_time, weights, losses, C_0, C_1, A):
    """A after a step in which C goes from C_0 to C_1, and what the branch dissipates [J/m^3]; weights:
    `relaxation_weights`; losses: `loss_weights` times tau [s]."""
    inverse_0, inverse_1 = inverse_symmetric(C_0), inverse_symmetric(C_1)
    A_1 = relaxed(weights, A, inverse_0, inverse_1)
    return A_1, relaxation_loss(modulus, relaxation_time, losses, C_0, inverse_0, A, C_1, inverse_1, A_1)


@inlined
def inverse_right_cauchy_green(H, J):
    """C^{-1} = H^T H/J^2."""
    C = gram(H)
    r = 1.0 / (J * J)
    return (r * C[0], r * C[1], r * C[2], r * C[3], r * C[4], r * C[5])


@inlined
def branch_energy(modulus, C, J, A):
    """Stored energy of a branch [J/m^3] (eq (20) with y = det A)."""
    return 0.5 * modulus * (contract_symmetric(C, A) - 3.0 - log(J * J * determinant_symmetric(A)))


@inlined
def branch_dissipation(modulus, relaxation_time, C, C_inverse, A):
    """Rate of dissipation of a branch [W/m^3]: (28) as mu/(2 tau) (C - A^{-1}) : (A - C^{-1}).

    It is -dW/dt at fixed F for any pair C, C_inverse. With F, H and J advanced separately these are inverses only to
    the error of the time integration, which (28) as printed divides by tau.
    """
    Y = combine_symmetric(1.0, C, -1.0, inverse_symmetric(A))
    X = combine_symmetric(1.0, A, -1.0, C_inverse)
    return (0.5 * modulus / relaxation_time) * contract_symmetric(Y, X)


@inlined
def relaxation_loss(modulus, relaxation_time, weights, C_0, C_0_inverse, A_0, C_1, C_1_inverse, A_1):
    """Energy that a branch dissipates over a step [J/m^3], never negative; weights: `loss_weights` times tau [s].

    The rate (28) is mu/(2 tau) Y : X, X = A - C^{-1}, Y = C - A^{-1} = C X A^{-1}. If C and A in it were constant, the
    mixed rate mu/(4 tau) (Y_0 : X_1 + Y_1 : X_0) would be at least minus the mean of both rates.
    """
    X_0 = combine_symmetric(1.0, A_0, -1.0, C_0_inverse)
    Y_0 = combine_symmetric(1.0, C_0, -1.0, inverse_symmetric(A_0))
    X_1 = combine_symmetric(1.0, A_1, -1.0, C_1_inverse)
    Y_1 = combine_symmetric(1.0, C_1, -1.0, inverse_symmetric(A_1))
    first, last = contract_symmetric(Y_0, X_0), contract_symmetric(Y_1, X_1)
    mixed = max(0.5 * (contract_symmetric(Y_0, X_1) + contract_symmetric(Y_1, X_0)), -0.5 * (first + last))
    return (0.5 * modulus / relaxation_time) * (weights[0] * first + weights[1] * mixed + weights[2] * last)


def relaxation_weights(step: float, relaxation_time: float) -> tuple[float, float, float]:
    """Weights of A_0, C_0^{-1}, C_1^{-1} over a step [s]; they sum to one and are those of A_0 alone for step 0."""
    x = step / relaxation_time
    if x == 0.0:
        return 1.0, 0.0, 0.0
    decay = math.exp(-x)
    phi = -math.expm1(-x) / x
    if x < 1e-5:
        # series, because 1 - phi cancels
        return decay, x * (0.5 - x / 3.0), x * (0.5 - x / 6.0)
    return decay, phi - decay, 1.0 - phi


def dissipation_factor(time: float, step: float, relaxation_time: float) -> float:
    """Factor on Simpson's weight of the rate at a time (0, 1/2 or 1 of the step), for a branch's dissipation.

    The weights that are exact for 1, s and exp(-2 s/tau), of which the rate (28) is made after a jump of C: with
    y = step/tau the middle has (cosh y - sinh y/y) / (cosh y - 1), 2/3 for y -> 0 and 1 for y -> infinity.
    """
    y = step / relaxation_time
    if y < 0.1:
        # series, because both cancel
        square = y * y
        over = 1.0 / 3.0 + square * (1.0 / 30.0 + square * (1.0 / 840.0 + square / 45360.0))
        middle = over / (0.5 + square * (1.0 / 24.0 + square * (1.0 / 720.0 + square / 40320.0)))
    else:
        middle = (1.0 - math.tanh(y) / y) / (1.0 - 2.0 * math.exp(-y) / (1.0 + math.exp(-2.0 * y)))
    return 1.5 * middle if time == 0.5 else 3.0 * (1.0 - middle)


def loss_weights(step: float, relaxation_time: float) -> tuple[float, float, float]:
    """Weights, of tau, in what a branch dissipates over a step: of its rate at the start, of the mixed rate of both
    ends, of the rate at the end (`relaxation_loss`).

    As C^{-1} is linear over the step, A - C^{-1} is that at the start times 1 - a(s) plus that at the end times a(s),
    a(s) = (1 - e^{-s/tau})/(1 - e^{-x}), x = step/tau: integrals of (1 - a)^2, 2 a (1 - a) and a^2. None is negative,
    and the second is at most twice the least of the others.
    """
    x = step / relaxation_time
    u = 0.5 * x
    square = u * u
    if x < 0.1:
        # series, because both cancel
        mixed = u * (1.0 / 3.0 - square * (2.0 / 45.0 - square * (2.0 / 315.0 - square * (4.0 / 4725.0))))
        start = u - square * (1.0 / 3.0 - square * (1.0 / 45.0 - square * (2.0 / 945.0)))
    else:
        decay, gone = math.exp(-x), -math.expm1(-x)
        mixed = 0.5 * (1.0 + decay) / gone - x * decay / (gone * gone)
        start = 1.0 - x * decay / gone
    return start - mixed, 2.0 * mixed, (x - start) - mixed
