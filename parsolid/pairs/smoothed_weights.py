"""Weights (g_ab, k_ab) of a smoothing kernel, with the corrections L_a that make gradients of linear fields exact."""

from typing import Any

import numpy as np

from parsolid.collective import raise_together
from parsolid.numerics.lanes import WIDTH, aligned_zeros
from parsolid.pairs import weights
from parsolid.pairs.closure import close
from parsolid.pairs.mean_impedance import whole_jump_factors
from parsolid.pairs.terms import MeanRiemann


class SmoothedWeights:
    """g_ab = V_a V_b grad_a W of a smoothing kernel; k_ab scales a Riemann dissipation."""

    def __init__(
        self, kernel: Any, dissipation: float = 1.0, surface: tuple[np.ndarray, np.ndarray] | None = None
    ) -> None:
        """kernel: of `smoothing.smoothing_kernel`; dissipation: factor on k_ab.

        surface: (area vectors (owned, d) [m^2], parts of the particles on this side of planes (owned,)) where the
        weights are to be closed, see `pairs.closure`.
        """
        self.kernel, self.dissipation, self.surface, self.support = kernel, dissipation, surface, kernel.support

    def empty(self, pairs: int) -> np.ndarray:
        """Room for the weights of so many pairs."""
        return aligned_zeros((pairs, WIDTH))

    def fill(self, system: Any, pairs: Any, places: Any) -> None:
        """g_ab of one list of a `PairSystem`."""
        weights.pair_weights(self.kernel, pairs, places, system.positions, system.metric, system.volume)

    def complete(self, system: Any) -> np.ndarray:
        """Corrections L_a (owned, d, d), and k_ab, when all lists are filled; collective.

        Raises SolverError on all ranks for a particle without neighbours and for weights that cannot be closed.
        """
        correction = corrections(system)
        if self.surface is not None:
            correction = close(system, correction, *self.surface, lambda: corrections(system))
        for pairs, places in system.lists():
            weights.jump_factors(self.dissipation, pairs, places, correction)
            if isinstance(system.terms, MeanRiemann):
                whole_jump_factors(pairs, correction.shape[1])
        return correction[: system.owned]


def corrections(system: Any) -> np.ndarray:
    """Corrections L_a (71) (n, d, d) of owned particles and ghosts from the weights; collective."""
    n, d = system.positions.shape
    owned, moment = system.owned, np.zeros((n, d, d))
    for pairs, places in system.lists():
        weights.add_moments(pairs, places, system.positions, moment)
    raise_together(system.comm, _lonely(moment[:owned], system.positions))
    return system.halo.with_ghosts(_inverse(moment[:owned] / system.volume[:owned, None, None]))


def _lonely(moment: np.ndarray, positions: np.ndarray) -> str | None:
    """Names the first particle that no other reaches."""
    alone = ~moment.any(axis=(1, 2))
    if not alone.any():
        return None
    place = ", ".join(f"{x:.6g}" for x in positions[np.argmax(alone)])
    return f"method.smoothing: expected every particle to have a neighbour, found none for that at ({place})"


def _inverse(moment: np.ndarray) -> np.ndarray:
    """Inverse of each moment (n, d, d); where neighbours do not span space (a single layer), the pseudo-inverse."""
    d = moment.shape[1]
    scale = np.abs(moment).max(axis=(1, 2), initial=0.0)
    good = np.abs(np.linalg.det(moment)) > 1e-8 * scale**d
    result = np.empty_like(moment)
    result[good] = np.linalg.inv(moment[good])
    result[~good] = np.linalg.pinv(moment[~good], rcond=1e-6)
    return result
