"""Generalised minimal residuals, for tangents that are not symmetric: loads that follow the shape."""

from collections.abc import Callable
from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.solvers.conjugate_gradients import Solution

# directions that are kept
_RESTART = 60


def gmres(
    comm: Any,
    apply: Callable[[np.ndarray, np.ndarray], None],
    load: np.ndarray,
    target: float,
    free: np.ndarray,
    limit: int,
    precondition: Callable[[np.ndarray], np.ndarray],
) -> Solution:
    """Solve K u = load on free components; collective. Arguments as in `conjugate_gradients`.

    Restarted, with the preconditioner on the right, so that its residual is that of the equations; two passes of
    Gram-Schmidt. Source: Y. Saad, M. H. Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856.
    """
    value, iterations = np.zeros_like(load), 0
    residual = load * free
    norm = float(np.sqrt(sums(comm, [np.vdot(residual, residual)])[0]))
    while norm > target and iterations < limit:
        before, basis, images = norm, [residual / norm], list[np.ndarray]()
        H, count = np.zeros((_RESTART + 1, _RESTART)), 0
        while count < _RESTART and norm > target and iterations + count < limit:
            images.append(precondition(basis[-1]) * free)
            new = np.empty_like(load)
            apply(images[-1], new)
            new *= free
            for _ in range(2):
                parts = sums(comm, [float(np.vdot(one, new)) for one in basis])
                H[: count + 1, count] += parts
                for part, one in zip(parts, basis):
                    new -= part * one
            H[count + 1, count] = size = float(np.sqrt(sums(comm, [np.vdot(new, new)])[0]))
            count += 1
            right = before * np.eye(count + 1)[0]
            factors = np.linalg.lstsq(H[: count + 1, :count], right, rcond=None)[0]
            norm = float(np.linalg.norm(right - H[: count + 1, :count] @ factors))
            if size <= 1e-14 * before or not np.isfinite(size):
                break
            basis.append(new / size)
        iterations += count
        for factor, image in zip(factors, images):
            value += factor * image
        product = np.empty_like(load)
        apply(value, product)
        iterations += 1
        residual = (load - product) * free
        norm = float(np.sqrt(sums(comm, [np.vdot(residual, residual)])[0]))
        if not norm < 0.999 * before:
            break
    reason = "" if norm <= target else f"no solution after {iterations} products"
    return Solution(value, iterations, norm, not reason, reason)
