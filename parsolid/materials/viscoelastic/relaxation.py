"""Maxwell branches of a single state over a step: internal variables, and the dissipation as an exact integral.

Over a step C^{-1} is taken as linear in time, as in `maxwell_lanes`; then A - C^{-1} has the closed
form
    D(s) = e^{-s/tau} D(0) - tau (1 - e^{-s/tau}) dC^{-1}/dt,
so that the dissipation (28) is the integral of mu/(2 tau) C : D A^{-1} D, which is smooth but may live in a short
layer.
"""

import math

import numpy as np

from decomposition.compiled import compiled
from parsolid.materials.hyperelastic.evaluation import six
from parsolid.materials.viscoelastic.maxwell_lanes import relaxation_weights, relaxed
from parsolid.numerics.tensors import SymmetricSpace, contract, expand, inverse_symmetric

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)


@compiled
def relax_branches(A, old_inverse, new_inverse, step, times, result):
    """A (m, 6) after a step [s] into result; inverses of C at both ends (6,), relaxation times (m,) [s].

    Rows hold 11, 22, 33, 12, 13, 23. A step of length 0 is a jump of the deformation and leaves A as it is.
    """
    old, new = _tensor(old_inverse), _tensor(new_inverse)
    for alpha in range(len(times)):
        values = relaxed(relaxation_weights(step, times[alpha]), six(A, alpha), old, new)
        for c in range(6):
            result[alpha, c] = values[c]


@compiled
def dissipated_energy(A, old_inverse, new_inverse, step, moduli, times):
    """Energy density [J/m^3] that all branches dissipate over a step [s]; arguments as in `relax_branches`.

    Never negative. Gauss quadrature on intervals that double from the start of the step, where the layer is: relative
    error below 1e-12 whatever step/tau.
    """
    result = 0.0
    if step == 0.0:
        return result
    old, new = _tensor(old_inverse), _tensor(new_inverse)
    rate = (1.0 / step) * (new - old)
    for alpha in range(len(times)):
        tau, start = times[alpha], six(A, alpha)
        excess = start - old
        # eigenvalues of C A approach 1 from no less than this, and the integrand is singular where they vanish
        least = 1.0 / contract(old, inverse_symmetric(start))
        lower, upper = 0.0, min(step, 0.5 * tau * min(1.0, least))
        while lower < step:
            part = 0.0
            for k in range(len(_NODES)):
                time = lower + 0.5 * (upper - lower) * (1.0 + _NODES[k])
                part += _WEIGHTS[k] * _rate(time, tau, excess, old, rate)
            result += 0.25 * moduli[alpha] / tau * (upper - lower) * part
            # what is left of the step is not worth an interval of its own
            lower, upper = upper, step if step < 2.2 * upper else 2.0 * upper
    return result


@compiled
def _rate(time, tau, excess, old, rate):
    """C : D A^{-1} D at a time of the step."""
    gone = -math.expm1(-time / tau)
    D = (1.0 - gone) * excess - tau * gone * rate
    inverse = old + time * rate
    A, C = inverse + D, inverse_symmetric(inverse)
    return contract(expand(C), D @ inverse_symmetric(A) @ D)


@compiled
def _tensor(a):
    return SymmetricSpace(a[0], a[1], a[2], a[3], a[4], a[5])
