"""Conjugate gradients: the default of quasi-static steps, because the correspondence operator is symmetric."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from decomposition.reduction import sums

# iterations after which it is asked whether there is a solution at all
_PATIENCE = 200


class Solution(NamedTuple):
    """What an iterative solver gives back.

    value (n, d): the solution on this rank; residual: the 2-norm of what is left over all ranks; reason: why it stopped
    early.
    """

    value: np.ndarray
    iterations: int
    residual: float
    converged: bool
    reason: str = ""


def conjugate_gradients(
    comm: MPI.Comm,
    apply: Callable[[np.ndarray, np.ndarray], None],
    load: np.ndarray,
    target: float,
    free: np.ndarray | None = None,
    limit: int | None = None,
    precondition: Callable[[np.ndarray], np.ndarray] | None = None,
    why_singular: Callable[[], str] | None = None,
) -> Solution:
    """Solve K u = load on free components for a symmetric positive definite K; collective.

    load (n, d) [N], only its free components are looked at; ends when |load - K u|_2 over all ranks is at most target
    [N], after `limit` products (default: ten times the number of components), or when a direction has no positive
    stiffness (`converged` is then false). Two global sums an iteration. precondition(r) gives M^-1 r (n, d), M
    symmetric positive definite, of a residual that is 0 where not free; why_singular() says, after many iterations or
    of such a direction, why there is no solution, or nothing. Source: M. R. Hestenes, E. Stiefel, J. Res. Nat. Bur.
    Standards 49 (1952) 409.
    """
    residual = load.copy() if free is None else load * free

    def preconditioned() -> np.ndarray:
        return residual if precondition is None else precondition(residual)

    z = preconditioned()
    solution, direction, product = np.zeros_like(residual), z.copy(), np.zeros_like(residual)
    square, power, count = sums(comm, [np.vdot(residual, residual), np.vdot(residual, z), float(residual.size)])
    limit = 10 * int(count) if limit is None else limit
    iterations, reason = 0, ""
    while square > target * target and not reason:
        reason = why_singular() if iterations == _PATIENCE and why_singular is not None else ""
        if reason := f"no solution after {limit} iterations" if iterations == limit else reason:
            break
        apply(direction, product)
        if free is not None:
            product *= free
        stiffness = float(sums(comm, [np.vdot(product, direction)])[0])
        iterations += 1
        if not stiffness > 0.0:
            # what nothing holds may show itself by rounding before many iterations are over
            reason = why_singular() if why_singular is not None and np.isfinite(stiffness) else ""
            if not reason:
                finite = np.isfinite(stiffness)
                reason = "a direction without positive stiffness" if finite else "a product that is not finite"
            break
        before, step = power, power / stiffness
        solution += step * direction
        product *= step
        residual -= product
        z = preconditioned()
        square, power = map(float, sums(comm, [np.vdot(residual, residual), np.vdot(residual, z)]))
        direction *= power / before
        direction += z
    if not reason and not np.isfinite(square):
        reason = "a residual that is not finite"
    return Solution(solution, iterations, float(np.sqrt(square)), not reason, reason)
