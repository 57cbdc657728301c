"""Maxwell branches with the internal variable A_alpha = C_v,alpha^{-1} (Lee et al., eqs (20), (26), (28)).

A relaxes towards C^{-1} with the time tau_alpha. Over a step with x = dt/tau, C^{-1} is taken as linear in time:
    A_1 = e^{-x} A_0 + (phi - e^{-x}) C_0^{-1} + (1 - phi) C_1^{-1},   phi = (1 - e^{-x})/x,
which is second order, unlike (78) that freezes C^{-1} over the step.
"""

import math

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.tensors import contract, determinant, formula, gram, inverse_symmetric


@compiled
def relaxation_weights(step, relaxation_time):
    """Weights (of A_0, C_0^{-1}, C_1^{-1}) over a step [s]; they sum to one and are those of A_0 alone for step 0."""
    x = step / relaxation_time
    if x == 0.0:
        return 1.0, 0.0, 0.0
    decay = math.exp(-x)
    phi = -math.expm1(-x) / x
    if x < 1e-5:
        # series, because 1 - phi cancels
        return decay, x * (0.5 - x / 3.0), x * (0.5 - x / 6.0)
    return decay, phi - decay, 1.0 - phi


@compiled
def dissipation_factor(time, step, relaxation_time):
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


@compiled
def loss_weights(step, relaxation_time):
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


@formula
def relaxed(weights, A, old_inverse, new_inverse):
    """A after a step with the given weights; symmetric tensors."""
    return weights[0] * A + (weights[1] * old_inverse + weights[2] * new_inverse)


@formula
def inverse_right_cauchy_green(H, J):
    """C^{-1} = H^T H / J^2."""
    return (1.0 / (J * J)) * gram(H)


@formula
def branch_dissipation(modulus, relaxation_time, C, C_inverse, A):
    """Rate of internal dissipation of one branch [W/m^3]: (28) as mu/(2 tau) (C - A^{-1}) : (A - C^{-1}).

    This is -dW/dt at fixed F for any pair C, C_inverse. With F, H and J evolved apart these are inverses only to the
    time integration's error, which (28) as printed would divide by tau.
    """
    return (0.5 * modulus / relaxation_time) * contract(C - inverse_symmetric(A), A - C_inverse)


@formula
def _difference(a, b):
    return a - b


@register_jitable
def relaxation_loss(modulus, relaxation_time, weights, C_0, C_0_inverse, A_0, C_1, C_1_inverse, A_1):
    """What one branch dissipates over a step [J/m^3], never negative; weights: `loss_weights` times tau [s].

    The rate (28) is mu/(2 tau) Y : X, X = A - C^{-1}, Y = C - A^{-1} = C X A^{-1}. If C and A in it were constant, the
    mixed rate mu/(4 tau) (Y_0 : X_1 + Y_1 : X_0) would be at least minus the mean of both rates.
    """
    X_0, Y_0 = _difference(A_0, C_0_inverse), _difference(C_0, inverse_symmetric(A_0))
    X_1, Y_1 = _difference(A_1, C_1_inverse), _difference(C_1, inverse_symmetric(A_1))
    first, last = contract(Y_0, X_0), contract(Y_1, X_1)
    mixed = max(0.5 * (contract(Y_0, X_1) + contract(Y_1, X_0)), -0.5 * (first + last))
    return (0.5 * modulus / relaxation_time) * (weights[0] * first + weights[1] * mixed + weights[2] * last)


@register_jitable
def branch_energy(modulus, C, J, A):
    """Stored energy of one branch [J/m^3] (eq (20) with y = det A)."""
    return 0.5 * modulus * (contract(C, A) - 3.0 - math.log(J * J * determinant(A)))
