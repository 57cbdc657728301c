"""Kernels that are called again with the same objects."""

from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.recalled import Recalled, RecalledEach


class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


@compiled
def weighted(pair, weight, more):
    return weight * pair.first.sum() + len(more) + pair.second.sum()


def test_other_objects_are_looked_at_anew():
    """An argument of another type between calls with the same ones is taken as what it is."""
    recalled, more = Recalled(weighted, free=(1,)), np.zeros(2)
    ones, both = Pair(np.ones(3), np.zeros(1)), Pair(np.arange(3), np.full((1, 1), 7.0))
    for pair, expected in ((ones, 3.0), (both, 3.0 + 7.0)) * 2:
        for weight in (1.0, 2.0, 3.0):
            assert recalled(pair, weight, more) == weight * 3.0 + 2.0 + (expected - 3.0)


def test_each_thing_has_machine_code_of_its_own():
    """Things that take turns do not drive each other's machine code out."""
    each, more = RecalledEach(weighted, free=(1,)), np.zeros(0)
    pairs = {"plain": Pair(np.ones(2), np.zeros(1)), "full": Pair(np.ones(2), np.ones((1, 1)))}
    for _ in range(3):
        assert [each(name, pair, 1.0, more) for name, pair in pairs.items()] == [2.0, 3.0]
    assert all(each._of[name]._code is not None for name in pairs)
