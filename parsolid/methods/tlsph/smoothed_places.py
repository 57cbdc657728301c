"""Places without what the gradient cannot see: what a new reference is made of.

A displacement that alternates from particle to particle has no gradient, hence no strain and no restoring force. A
reference that took it over would push it on under stress (the tensile instability of moving particles): in the punch of
33 x 33 particles most of the energy is gone after 12 ms. So every particle is moved to the mean of what its neighbours'
places and gradients say of its own place, 1-2-1 along each axis of a lattice, where an alternating field leaves nothing
and a linear one all; what is taken from smooth fields is of fourth order in the spacing.
"""

from typing import Any

import numpy as np

from parsolid.methods.tlsph.smoothing_sums import add_deviations, add_differences
from parsolid.pairs.lists import images_of
from parsolid.pairs.pair_system import PairSystem

# after one pass the punch with an update in every step still breaks up; after two it does not
PASSES = 3


def _lists(pairs: PairSystem) -> Any:
    """Every list, its places, and the signs Q (codes, 3) of its images."""
    for one, places in pairs.lists():
        yield one, places, np.ones((1, 3)) if images_of(one) is None else pairs.codes.signs


def gradient_of(pairs: PairSystem, displacement: np.ndarray, correction: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """G (owned, d, d) of a displacement (owned, d) [m]; correction L (owned, d, d) and volume (owned,) go with the
    weights. Collective."""
    values = pairs.halo.with_ghosts(displacement)
    sums = np.zeros((*values.shape, values.shape[1]))
    for one, places, signs in _lists(pairs):
        add_differences(one, places, signs, values, sums)
    return sums[: pairs.owned] @ correction.swapaxes(1, 2) / volume[:, None, None]


def smoothed(
    pairs: PairSystem, smoothing: float, position: np.ndarray, correction: np.ndarray, volume: np.ndarray, free: Any
) -> np.ndarray:
    """Smoothed places (owned, d) [m] of particles at `position`, by the lists of where they were; collective.

    smoothing: h over the spacing; free: 0 for components that are held, else 1, (owned, d), or 1.
    """
    place, held = position.copy(), pairs.positions[: pairs.owned]
    for _ in range(PASSES):
        displacement = np.ascontiguousarray(place - held)
        gradient = pairs.halo.with_ghosts(gradient_of(pairs, displacement, correction, volume))
        values = pairs.halo.with_ghosts(displacement)
        deviation, weight = np.zeros_like(values), np.zeros(len(values))
        for one, places, signs in _lists(pairs):
            add_deviations(
                one, places, signs, pairs.positions, pairs.metric, smoothing, values, gradient, deviation, weight
            )
        place += free * deviation[: pairs.owned] / (1.0 + weight[: pairs.owned, None])
    return place
