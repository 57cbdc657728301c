"""Adaptive dynamic relaxation: a damped fictitious motion that comes to rest where forces balance.

Source: B. Kilic, E. Madenci, "An adaptive dynamic relaxation method for quasi-static simulations using the peridynamic
theory", Theoretical and Applied Fracture Mechanics 53 (2010) 194; the fictitious time step is 1.
"""

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from decomposition.reduction import sums
from parsolid.solvers.conjugate_gradients import Solution

# more damping than critical for the highest mode would make the fictitious motion creep
_LARGEST_DAMPING = 1.9
# a square of the force so many times the first one's is that of a motion that diverges
_GROWTH = 1e12
# Gerschgorin's bound asks for lambda/4, and the eigenvalue of a power iteration comes from below
_MARGIN = 1.1


def relaxation_mass(largest_eigenvalue: float, mass: np.ndarray) -> np.ndarray:
    """Fictitious masses (n,) with which the motion is stable: (1.1/4) lambda_max of M^-1 K, times M (n,).

    The stiffness must be that of the whole material step, or the motion diverges at once.
    """
    return 0.25 * _MARGIN * largest_eigenvalue * mass


def _measure(
    force: np.ndarray, before: np.ndarray, velocity: np.ndarray, displacement: np.ndarray, mass: np.ndarray
) -> tuple[float, float, float]:
    """This rank's (F . F, sum k u^2, sum u^2) with k = -(F/L - F_before/L)/v, nothing where v = 0."""
    squares, stiffness = displacement**2, np.zeros(force.shape)
    np.divide(before - force, mass[:, None] * velocity, out=stiffness, where=velocity != 0.0)
    return float(np.vdot(force, force)), float(np.vdot(stiffness, squares)), float(squares.sum())


def dynamic_relaxation(
    comm: MPI.Comm,
    force: Callable[[np.ndarray, np.ndarray], None],
    start: np.ndarray,
    mass: np.ndarray,
    target: float,
    free: np.ndarray | None = None,
    limit: int = 100_000,
) -> Solution:
    """The displacement at which the force vanishes on free components; collective.

    force(u, out) writes internal and external forces [N] of a displacement (n, d) [m] into out; start (n, d): first
    guess, with prescribed components in place; mass (n,): see `relaxation_mass`. Ends when |F|_2 over all ranks is at
    most target [N] or after `limit` evaluations (`converged` is then false). One global sum of three numbers an
    iteration.
    """
    displacement, velocity = start.copy(), np.zeros(start.shape)
    total, before = np.zeros(start.shape), np.zeros(start.shape)
    evaluations, reason = 0, ""
    while True:
        force(displacement, total)
        evaluations += 1
        if free is not None:
            total *= free
        square, stiffness, weight = sums(comm, _measure(total, before, velocity, displacement, mass))
        if square <= target * target:
            break
        if evaluations == 1:
            bound = _GROWTH * square
        if not square <= bound:
            reason = "the fictitious motion diverges"
        elif evaluations >= limit:
            reason = f"no balance after {limit} iterations"
        if reason:
            break
        damping = 0.0
        if evaluations > 1 and stiffness > 0.0 and weight > 0.0:
            damping = min(2.0 * np.sqrt(stiffness / weight), _LARGEST_DAMPING)
        pushed = total / mass[:, None]
        if evaluations == 1:
            velocity[:] = 0.5 * pushed
        else:
            velocity[:] = ((2.0 - damping) * velocity + 2.0 * pushed) / (2.0 + damping)
        displacement += velocity
        before[:] = total
    return Solution(displacement, evaluations, float(np.sqrt(square)), not reason, reason)
