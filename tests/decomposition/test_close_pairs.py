"""Pairs of points closer than the sum of their radii, against brute force and against cell lists."""

import numpy as np
import pytest
from point_sets import KINDS, point_set

from decomposition import half_pairs
from decomposition.close_pairs import ClosePairs


def brute_force(points, radius, owned):
    """Pairs (first < second) with an owned point, of owned points and with others."""
    square = np.zeros((len(points), len(points)))
    for x in points.T:
        square += (x[:, None] - x[None, :]) ** 2
    near = np.triu(square < (radius[:, None] + radius[None, :]) ** 2, 1)
    return np.argwhere(near[:owned, :owned]), np.argwhere(near[:owned, owned:]) + np.array([0, owned])


def found(start, neighbour):
    """The rows' pairs in the same form."""
    pairs = np.sort(np.column_stack((np.repeat(np.arange(len(start) - 1), np.diff(start)), neighbour)), axis=1)
    return pairs[np.lexsort(pairs.T[::-1])]


@pytest.mark.parametrize("reach", [1e-9, 0.125, 0.3, 1e9])
@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_close_pairs_equal_brute_force(kind, dimension, reach):
    points, search = point_set(kind, dimension), ClosePairs()
    even, uneven = np.full(len(points), 0.5 * reach), np.random.default_rng(1).uniform(0.15, 0.5, len(points)) * reach
    for radius in (even, uneven):
        for owned in {0, len(points) // 3, len(points)}:
            result = search.find(points, radius, owned)
            for lists, expected in zip((result[:2], result[2:]), brute_force(points, radius, owned)):
                assert len(lists[0]) == owned + 1 and lists[1].dtype == np.int32
                np.testing.assert_array_equal(found(*lists), expected.reshape(-1, 2))


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_close_pairs_are_those_of_cell_lists(dimension):
    # a long, thin and slanted cloud in many strips, found again with buffers that are kept
    random, search = np.random.default_rng(dimension), ClosePairs()
    for count in (3000, 500, 4000):
        points = np.linspace(0.0, 60.0, count)[:, None] + random.uniform(-1.0, 1.0, (count, dimension))
        start, neighbour, _, _ = search.find(points, np.full(count, 0.2), count)
        np.testing.assert_array_equal(found(start, neighbour), found(*half_pairs(points, count, 0.4)))


def test_rows_of_sorted_points_rise():
    points = np.argwhere(np.ones((40, 7))).astype(float)
    start, neighbour, _, _ = ClosePairs().find(points, np.full(len(points), 0.8), len(points))
    row = np.repeat(np.arange(len(points)), np.diff(start))
    # strips are wider than a row of the lattice, so a neighbour is one of the next two strips
    assert np.abs(neighbour - row).max() < 4 * 7


@pytest.mark.parametrize(
    "points, radius, owned, word",
    [
        (np.zeros((3, 4)), np.ones(3), 3, "points"),
        (np.array([[0.0], [np.nan]]), np.ones(2), 2, "points"),
        (np.zeros((3, 2)), np.ones(3), 4, "owned"),
        (np.zeros((3, 2)), np.ones(2), 3, "radius"),
        (np.zeros((3, 2)), np.array([1.0, 0.0, 1.0]), 3, "radius"),
        (np.zeros((3, 2)), np.array([1.0, np.nan, 1.0]), 3, "radius"),
    ],
)
def test_wrong_arguments_are_named(points, radius, owned, word):
    with pytest.raises(ValueError, match=f"^{word}: expected"):
        ClosePairs().find(points, radius, owned)
