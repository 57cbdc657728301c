"""Weights (g_ab, k_ab) of a smoothing kernel, with the corrections L_a that make gradients of linear fields exact."""

from typing import Any

import numpy as np

from parsolid.collective import raise_together
from parsolid.numerics.lanes import WIDTH, aligned_zeros
from parsolid.pairs import weights
from parsolid.pairs.axis_lists import along_axes
from parsolid.pairs.block_lists import in_blocks
from parsolid.pairs.closure import close
from parsolid.pairs.lattice_pairs import Lattices, fill_lattice_weights, keep_lattice_pairs, keep_near_jumps
from parsolid.pairs.mean_impedance import whole_jump_factors
from parsolid.pairs.terms import MeanRiemann
from parsolid.pairs.weight_tables import by_tables
from parsolid.pairs.weights import PairWeights


class SmoothedWeights(PairWeights):
    """g_ab = V_a V_b grad_a W of a smoothing kernel, or of a lattice in closed form; k_ab scales a Riemann
    dissipation."""

    def __init__(
        self,
        kernel: Any,
        dissipation: float = 1.0,
        surface: Any = None,
        lattices: Lattices | None = None,
        tabled: bool = False,
    ) -> None:
        """kernel: of `smoothing.smoothing_kernel`; dissipation: factor on k_ab.

        surface: what `pairs.closure.Closure` takes of the particles whose weights are to be closed: (area vectors
        (owned, d) [m^2], parts of the particles on this side of planes (owned,), and which (owned,) unless all);
        lattices: those of owned particles; pairs of two lattices, or of one and a particle on none, have no weight;
        tabled: whether weights are to stand in tables where few differ (`weight_tables`), for which those of a kernel
        alone are rounded to float32. Not those that are closed, nor in space with lattices.
        """
        self.kernel, self.dissipation, self.surface, self.support = kernel, dissipation, surface, kernel.support
        self.lattices = lattices
        # not by what stands on this rank: a pair of two ranks has the same k_ab on both
        self.tabled = tabled and surface is None and (lattices is None or lattices.spacing.shape[1] == 2)
        self._rounded = self.tabled and lattices is None

    def empty(self, pairs: int) -> np.ndarray:
        """Room for the weights of so many pairs."""
        return aligned_zeros((pairs, WIDTH))

    def fill(self, system: Any, pairs: Any, places: Any) -> None:
        """g_ab of one list of a `PairSystem`."""
        weights.pair_weights(self.kernel, pairs, places, system.positions, system.metric, system.volume)
        if self.lattices is not None:
            fill_lattice_weights(self.lattices, pairs, places, system.even)
        if self._rounded:
            # before corrections are found: gradients of linear fields stay exact
            pairs.weight[:] = pairs.weight.astype(np.float32)

    def kept(
        self, system: Any, start: np.ndarray, neighbour: np.ndarray, code: np.ndarray, *places: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Those on one lattice with a weight, or both on none; collective."""
        if self.lattices is None:
            return start, neighbour, code
        number = system.halo.with_ghosts(self.lattices.number)
        return keep_lattice_pairs(self.lattices, number, start, neighbour, code, system.even, *places)

    def complete(self, system: Any) -> np.ndarray:
        """Corrections L_a (owned, d, d), and k_ab, when all lists are filled; collective.

        Raises SolverError on all ranks for a particle without neighbours and for weights that cannot be closed.
        """
        correction = corrections(system)
        if self.surface is not None:
            correction = close(system, correction, self.surface, lambda: corrections(system))
        for pairs, places in system.lists():
            weights.jump_factors(self.dissipation, pairs, places, correction)
            if self.lattices is not None:
                keep_near_jumps(self.lattices, pairs, places, system.even)
            if isinstance(system.terms, MeanRiemann):
                whole_jump_factors(pairs, correction.shape[1])
        return correction[: system.owned]

    def walked(self, system: Any) -> tuple[Any, Any]:
        """Along axes where all pairs are on lattices in space; with tables where few weights differ, by blocks where
        particles lie in rows, too."""
        plain, found = (system.inner, system.rim), None
        dissipates = isinstance(system.terms, MeanRiemann) or system.terms is None
        if self.lattices is not None and system.space.dimension == 3 and dissipates:
            found = along_axes(self.lattices, *plain, system.even, system.positions, self.dissipation)
        if self.tabled:
            for pairs in filter(None, (*plain, system.mirror)):
                # any k_ab will do that both particles have
                pairs.weight[:, system.space.dimension] = pairs.weight[:, system.space.dimension].astype(np.float32)
            found = by_tables(*plain, system.positions)
            blocks = in_blocks(found[0], system.space.dimension) if found and _reconstructed(system.terms) else None
            found = (blocks, found[1]) if found and blocks is not None else found
        return found or plain


def _reconstructed(terms: Any) -> bool:
    return isinstance(terms, MeanRiemann) and terms.reconstruction is not None


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
