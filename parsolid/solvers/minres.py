"""Minimal residuals, for symmetric matrices that are not definite: equilibria with pressures as unknowns."""

from collections.abc import Callable
from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.solvers.conjugate_gradients import Solution


def minres(
    comm: Any,
    apply: Callable[[np.ndarray, np.ndarray], None],
    load: np.ndarray,
    target: float,
    free: np.ndarray,
    limit: int,
    precondition: Callable[[np.ndarray], np.ndarray],
) -> Solution:
    """Solve K x = load on free components; collective. Arguments as in `conjugate_gradients`.

    What falls from product to product is the residual's norm in the preconditioner, which must be positive definite;
    the residual itself follows from the same recurrence, so that it ends as the others do. Two global sums a product.
    Source: C. C. Paige, M. A. Saunders, SIAM J. Numer. Anal. 12 (1975) 617.
    """
    image = load * free
    value, direction, last_direction = (np.zeros_like(image) for _ in range(3))
    last, residual, preconditioned = np.zeros_like(image), image.copy(), precondition(image)
    power, square = sums(comm, [np.vdot(image, preconditioned), np.vdot(image, image)])
    last_beta, beta, iterations = 1.0, float(np.sqrt(max(power, 0.0))), 0
    # of the reflections that make the tridiagonal matrix of the products triangular
    left, diagonal, beside, cosine, sine = beta, 0.0, 0.0, -1.0, 0.0
    while square > target * target and iterations < limit and beta > 0.0 and np.isfinite(square):
        vector, product = preconditioned / beta, np.empty_like(image)
        apply(vector, product)
        product *= free
        iterations += 1
        product -= (beta / last_beta) * last
        alpha = float(sums(comm, [np.vdot(vector, product)])[0])
        product -= (alpha / beta) * image
        last, image = image, product
        preconditioned = precondition(image)
        parts = [np.vdot(image, preconditioned), np.vdot(residual, image), np.vdot(image, image)]
        power, both, own = map(float, sums(comm, parts))
        last_beta, beta = beta, float(np.sqrt(max(power, 0.0)))
        before, above, across = beside, cosine * diagonal + sine * alpha, sine * diagonal - cosine * alpha
        beside, diagonal = sine * beta, -cosine * beta
        size = max(float(np.hypot(across, beta)), np.finfo(float).tiny)
        cosine, sine = across / size, beta / size
        step, left = cosine * left, sine * left
        new = (vector - before * last_direction - above * direction) / size
        last_direction, direction = direction, new
        value += step * new
        kept, added = sine * sine, -left * cosine / max(beta, np.finfo(float).tiny)
        square = kept * kept * square + 2.0 * kept * added * both + added * added * own
        residual *= kept
        residual += added * image
    square = float(sums(comm, [np.vdot(residual, residual)])[0])
    converged = bool(square <= (target * (1.0 + 1e-6)) ** 2)
    reason = "" if converged else f"no solution after {iterations} iterations"
    return Solution(value, iterations, float(np.sqrt(square)), converged, reason)
