"""Pairs that a sweep leaves out are beyond the support, wherever particles have moved since they were looked at."""

import numpy as np
import pytest

from parsolid.methods.ulsph.near_pairs import NearPairs
from parsolid.pairs.verlet_list import Pairs

SUPPORT, SKIN = 2.0, 0.25


def within(pairs: Pairs, motion: np.ndarray, first: int, d: int, length: int) -> set[tuple[int, int]]:
    """Pairs of a list that are within the support."""
    a, b = pairs.particle, pairs.neighbour
    h = 0.5 * (motion[a, length] + motion[b, length])
    r = np.linalg.norm(motion[a, first : first + d] - motion[b, first : first + d], axis=1)
    return {(int(i), int(j)) for i, j in zip(a[r < SUPPORT * h], b[r < SUPPORT * h])}


def listed(motion: np.ndarray, first: int, d: int, length: int) -> Pairs:
    """All pairs within the support and a skin, each once."""
    n, neighbours = len(motion), []
    for a in range(n):
        r = np.linalg.norm(motion[a + 1 :, first : first + d] - motion[a, first : first + d], axis=1)
        h = 0.5 * (motion[a, length] + motion[a + 1 :, length])
        neighbours.append(a + 1 + np.flatnonzero(r < (1.0 + SKIN) * SUPPORT * h))
    start = np.concatenate(([0], np.cumsum([len(one) for one in neighbours])))
    return Pairs(start.astype(np.int64), np.concatenate(neighbours).astype(np.int32))


@pytest.mark.parametrize("d, first, length", [(2, 2, 5), (3, 4, 7)])
@pytest.mark.parametrize("stride, looks", [(0.003, 2), (0.02, 12), (0.2, 12)])
def test_no_pair_within_the_support_is_left_out(d, first, length, stride, looks):
    """Particles that part by so much a sweep while all of them fly together; how often the whole list is looked at."""
    random = np.random.default_rng(7)
    motion = np.zeros((120, 8))
    motion[:, first : first + d] = random.uniform(0.0, 6.0 if d == 2 else 4.0, (120, d))
    motion[:, length] = random.uniform(0.35, 0.6, 120)
    pairs = listed(motion, first, d, length)
    number = np.arange(len(pairs.neighbour), dtype=float)
    near, seen, before = NearPairs(pairs, number, len(motion), d, SUPPORT), 0, None
    drift = random.normal(size=(120, d))
    drift *= stride / np.linalg.norm(drift, axis=1).max()
    for _ in range(12):
        found, told = near.find(motion)
        count = int(found.start[-1])
        chosen = list(zip(found.particle.tolist(), found.neighbour[:count].tolist()))
        assert within(pairs, motion, first, d, length) <= set(chosen) and count < 0.9 * len(number)
        # in the order of the list, each with its number
        at = told[:count].astype(int)
        assert (np.diff(at) > 0).all() and chosen == list(zip(pairs.particle[at], pairs.neighbour[at]))
        seen, before = seen + (chosen != before), chosen
        motion[:, first : first + d] += 3.0 + drift
    assert 2 <= seen <= looks


def test_a_particle_that_is_nowhere_has_no_pairs():
    motion = np.zeros((3, 8))
    motion[:, 2], motion[:, 5] = (0.0, 0.5, 1.1), 0.5
    near = NearPairs(listed(motion, 2, 2, 5), None, 3, 2, SUPPORT)
    assert near.find(motion)[0].start[-1] == 2 and near.find(motion)[1] is None
    motion[2, 2] = np.nan
    assert near.find(motion)[0].start[-1] == 1
    motion[2, 2] = 0.9
    assert near.find(motion)[0].start[-1] == 3
