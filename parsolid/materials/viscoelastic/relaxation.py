"""Maxwell branches of single states over a step: internal variables, energies, and the dissipation as an exact
integral.

Over a step C^{-1} is taken as linear in time, as in `materials.viscoelastic.maxwell`; then A - C^{-1} has the closed
form

    D(s) = e^{-s/tau} D(0) - tau (1 - e^{-s/tau}) dC^{-1}/dt,

so that the dissipation (28) is the integral of mu/(2 tau) C : D A^{-1} D, which is smooth but may live in a short
layer. Rows hold 11, 22, 33, 12, 13, 23.
"""

import math

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.materials.viscoelastic.maxwell import branch_energy, relaxation_weights
from parsolid.tensors import (
    combine_symmetric,
    contract,
    contract_symmetric,
    determinant_symmetric,
    general,
    inverse_symmetric,
    matmul,
)

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)


def relaxed_branches(A: np.ndarray, old_inverse: np.ndarray, new_inverse: np.ndarray, step: float, times) -> np.ndarray:
    """A (m, 6) after a step [s] from C^{-1} at both ends (6,), relaxation times (m,) [s].

    A step of length 0 is a jump of the deformation and leaves A as it is.
    """
    weights = np.array([relaxation_weights(step, time) for time in times]).reshape(-1, 3)
    return weights[:, :1] * A + (weights[:, 1:2] * old_inverse + weights[:, 2:] * new_inverse)


@inlined
def _row(a, i):
    return (a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5])


@kernel
def branch_states(moduli, times, C, A, stored, rates):
    """Stored energy [J/m^3] and rate of dissipation [W/m^3] (n, m) of every branch, from C (n, 6) and A (n, m, 6)."""
    for i in range(len(C)):
        c = _row(C, i)
        J, inverse = determinant_symmetric(c) ** 0.5, inverse_symmetric(c)
        for alpha in range(len(moduli)):
            a = _row(A[i], alpha)
            stored[i, alpha] = branch_energy(moduli[alpha], c, J, a)
            # not negative for rounding: the excess is squared
            excess = combine_symmetric(1.0, a, -1.0, inverse)
            rates[i, alpha] = 0.5 * moduli[alpha] / times[alpha] * _excess_form(c, excess, a)


@inlined
def _excess_form(C, D, A):
    """C : D A^{-1} D."""
    return contract(general(C), matmul(matmul(general(D), general(inverse_symmetric(A))), general(D)))


@kernel
def dissipated_energy(A, old_inverse, new_inverse, step, moduli, times):
    """Energy density [J/m^3] that all branches dissipate over a step [s]; arguments as in `relaxed_branches`, C^{-1}
    as (1, 6).

    Never negative. Gauss quadrature on intervals that double from the start of the step, where the layer is: relative
    error below 1e-12 whatever step/tau.
    """
    result = 0.0
    if step == 0.0:
        return result
    old, new = _row(old_inverse, 0), _row(new_inverse, 0)
    rate = combine_symmetric(1.0 / step, new, -1.0 / step, old)
    for alpha in range(len(times)):
        tau, start = times[alpha], _row(A, alpha)
        excess = combine_symmetric(1.0, start, -1.0, old)
        # eigenvalues of C A approach 1 from no less than this, and the integrand is singular where they vanish
        least = 1.0 / contract_symmetric(old, inverse_symmetric(start))
        lower, upper = 0.0, min(step, 0.5 * tau * min(1.0, least))
        while lower < step:
            part = 0.0
            for k in range(len(_NODES)):
                time = lower + 0.5 * (upper - lower) * (1.0 + _NODES[k])
                gone = -math.expm1(-time / tau)
                D = combine_symmetric(1.0 - gone, excess, -tau * gone, rate)
                inverse = combine_symmetric(1.0, old, time, rate)
                C = inverse_symmetric(inverse)
                part += _WEIGHTS[k] * _excess_form(C, D, combine_symmetric(1.0, inverse, 1.0, D))
            result += 0.25 * moduli[alpha] / tau * (upper - lower) * part
            # what is left of the step is not worth an interval of its own
            lower, upper = upper, step if step < 2.2 * upper else 2.0 * upper
    return result
