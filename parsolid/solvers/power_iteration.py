"""The largest eigenvalue of M^-1 K by power iteration; the mean one as the scale of a diagonal."""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.reduction import sums

# the estimate rises from below; what it still gains over so many iterations is the measure of its error
_WINDOW = 10


def start_vector(identifier: np.ndarray, dimension: int) -> np.ndarray:
    """Components (n, d) within -1 .. 1 that look random and depend on the particles' identifiers (n,) alone.

    Source: the finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014).
    """
    keys: Any = identifier.astype(np.uint64)[:, None] * np.uint64(dimension) + np.arange(
        1, dimension + 1, dtype=np.uint64
    )
    with np.errstate(over="ignore"):
        keys *= np.uint64(0x9E3779B97F4A7C15)
        keys = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        keys = (keys ^ (keys >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    keys ^= keys >> np.uint64(31)
    return keys.astype(np.float64) * 2.0**-63 - 1.0


def largest_eigenvalue(
    comm: MPI.Comm,
    apply: Callable[[np.ndarray, np.ndarray], None],
    start: np.ndarray,
    mass: np.ndarray | None = None,
    free: np.ndarray | None = None,
    iterations: int = 200,
    tolerance: float = 2e-3,
) -> float:
    """The largest |eigenvalue| of K x = lambda M x on free components, from below; collective.

    start (n, d): any vector with a part of the wanted one, see `start_vector`; mass (n,) [kg] or None for 1. Stops when
    ten iterations gain less than the tolerance, relative. Gives inf where a product is not finite, 0.0 where all are 0.
    For a symmetric K the estimate |M^-1 K x| / |x| is never less than the Rayleigh quotient of x, and never more than
    lambda.
    """
    weight = None if mass is None else mass[:, None]
    x = start.copy() if free is None else start * free
    y = np.empty_like(x)
    norm = _norm(comm, x, weight)
    if norm == 0.0:
        return 0.0
    x /= norm
    estimates: list[float] = []
    while len(estimates) < iterations:
        apply(x, y)
        if free is not None:
            y *= free
        if weight is not None:
            y /= weight
        norm = _norm(comm, y, weight)
        if not np.isfinite(norm):
            return np.inf
        estimates.append(norm)
        if norm == 0.0 or (len(estimates) > _WINDOW and norm - estimates[-1 - _WINDOW] <= tolerance * norm):
            break
        np.multiply(y, 1.0 / norm, out=x)
    return estimates[-1]


def scaled_diagonal(comm: MPI.Comm, estimate: np.ndarray, trial: np.ndarray, image: np.ndarray) -> np.ndarray:
    """A diagonal D (n, d) in proportion to an estimate, with u . D u = u . K u of one vector u; the estimate itself
    where u is 0; collective.

    trial (n, d): u, signs of a `start_vector`, 0 where not free; image (n, d): K u.
    """
    power, measure = sums(comm, [np.vdot(trial, image), np.vdot(trial, estimate * trial)])
    return estimate * float(power / measure) if measure > 0.0 else estimate


def _norm(comm: MPI.Comm, vector: np.ndarray, weight: np.ndarray | None) -> float:
    """sqrt(x . M x) over all ranks."""
    square = np.vdot(vector, vector if weight is None else weight * vector)
    return float(np.sqrt(sums(comm, [square])[0]))
