"""Places without what the gradient cannot see: what a new reference is made of.

A displacement that alternates from particle to particle has no gradient, hence no strain and no restoring force. A
reference that took it over would push it on under stress (the tensile instability of moving particles): in the punch of
33 x 33 particles most of the energy is gone after 12 ms. So every particle is moved to the mean of what its neighbours'
places and gradients say of its own place, 1-2-1 along each axis of a lattice, where an alternating field leaves nothing
and a linear one all; what is taken from smooth fields is of fourth order in the spacing.
"""

from typing import Any

import numpy as np

from decomposition.compiled import compiled
from parsolid.pairs.lists import images_of, mutual
from parsolid.pairs.pair_system import PairSystem
from parsolid.pairs.weights import distance_in_support

# after one pass the punch with an update in every step still breaks up; after two it does not
PASSES = 3
# neighbours farther than this many spacings, squared, do not count: the 1-2-1 of a lattice ends at its cubes' corners
_FARTHEST = 3.5


@compiled
def add_differences(pairs, places, signs, values, sums):
    """Add sum_b (Q u_b - u_a) (x) g_ab to sums (n, d, d); values u (n, d), signs Q (codes, 3) of the images."""
    d = values.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], places.code[k]
            for i in range(d):
                step = signs[code, i] * values[b, i] - values[a, i]
                for j in range(d):
                    sums[a, i, j] += step * pairs.weight[k, j]
                    if mutual(pairs):
                        sums[b, i, j] += step * pairs.weight[k, j]


@compiled
def add_deviations(pairs, places, signs, positions, metric, smoothing, values, gradient, deviation, weight):
    """Add 2^(-s^2) times Q u_b - u_a - 1/2 (G_a + Q G_b R) (X_b - X_a) to deviation (n, d), and 2^(-s^2) to weight.

    s: the distance in spacings, smoothing (h over the spacing) times that of `pairs.weights`.
    """
    d = values.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, code = pairs.neighbour[k], places.code[k]
            Q, R, T = signs[code], places.reflections[code], places.shifts[code]
            square = (smoothing * distance_in_support(positions, metric, a, b, R, T)) ** 2
            if square < _FARTHEST:
                w = 2.0**-square
                weight[a] += w
                if mutual(pairs):
                    weight[b] += w
                for i in range(d):
                    jump = Q[i] * values[b, i] - values[a, i]
                    for j in range(d):
                        step = R[j] * positions[b, j] + T[j] - positions[a, j]
                        jump -= 0.5 * (gradient[a, i, j] + Q[i] * R[j] * gradient[b, i, j]) * step
                    deviation[a, i] += w * jump
                    if mutual(pairs):
                        deviation[b, i] -= w * jump


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
