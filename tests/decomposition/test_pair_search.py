"""Pairs of points closer than the sum of their radii, or than one reach, against brute force."""

import numpy as np
import pytest
from point_sets import KINDS, close, lattice, point_set

from decomposition.pair_search import ClosePairs, close_boxes, half_pairs, stable_order, within_reach

# on the lattice, whose spacing is 1 / 8, both reaches equal distances between points: the test must be strict
REACHES = [0.125, 0.25, 0.3]


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
def test_pairs_of_a_slanted_cloud_that_is_searched_again(dimension):
    # long, thin and in many strips, found with buffers that are kept
    random, search = np.random.default_rng(dimension), ClosePairs()
    for count in (1500, 300, 2000):
        points = np.linspace(0.0, 30.0, count)[:, None] + random.uniform(-1.0, 1.0, (count, dimension))
        start, neighbour, _, _ = search.find(points, np.full(count, 0.2), count)
        expected = np.argwhere(np.triu(close(points, points, 0.4), 1))
        np.testing.assert_array_equal(found(start, neighbour), expected)


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


# --- rising rows, and points that have others near


def rising_brute_force(points, owned, reach):
    near = close(points[:owned], points, reach)
    near &= np.arange(len(points))[None, :] > np.arange(owned)[:, None]
    rows, neighbour = np.nonzero(near)
    return np.searchsorted(rows, np.arange(owned + 1)), neighbour


@pytest.mark.parametrize("reach", REACHES)
@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_half_pairs_equal_brute_force(kind, dimension, reach):
    points = point_set(kind, dimension)
    for owned in {0, len(points) // 3, len(points)}:
        start, neighbour = half_pairs(points, owned, reach)
        expected_start, expected = rising_brute_force(points, owned, reach)
        assert start.dtype == np.int64 and neighbour.dtype == np.int32
        np.testing.assert_array_equal(start, expected_start)
        np.testing.assert_array_equal(neighbour, expected)


def test_order_and_layout_of_input_do_not_change_the_pairs():
    points = point_set("random", 3)
    padded = np.zeros((len(points), 4))
    padded[:, :3] = points
    expected = half_pairs(points, 250, 0.2)
    for view in (padded[:, :3], np.asfortranarray(points)):
        for found, wanted in zip(half_pairs(view, 250, 0.2), expected):
            np.testing.assert_array_equal(found, wanted)
    order = np.random.default_rng(5).permutation(len(points))
    start, neighbour = half_pairs(points[order], len(points), 0.2)
    rows = np.repeat(np.arange(len(points)), np.diff(start))
    found = {frozenset(pair) for pair in zip(order[rows].tolist(), order[neighbour].tolist())}
    start, neighbour = half_pairs(points, len(points), 0.2)
    rows = np.repeat(np.arange(len(points)), np.diff(start))
    assert found == {frozenset(pair) for pair in zip(rows.tolist(), neighbour.tolist())}


def test_count_on_a_large_lattice():
    edge = 30
    points = lattice(edge, 3)
    start, neighbour = half_pairs(points, len(points), 1.5)
    # faces and diagonals of faces; a shift by s along k axes leaves (edge - 1)**k edge**(3 - k) pairs
    assert len(neighbour) == 3 * (edge - 1) * edge**2 + 6 * (edge - 1) ** 2 * edge
    assert start[-1] == len(neighbour)


def test_reach_far_below_and_above_the_extent():
    points = point_set("random", 3)
    start, neighbour = half_pairs(points, len(points), 1e-9)
    assert len(neighbour) == 0 and start[-1] == 0
    _, neighbour = half_pairs(points, len(points), 1e9)
    assert len(neighbour) == len(points) * (len(points) - 1) // 2


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_points_within_reach(dimension):
    random = np.random.default_rng(3)
    points, others = random.random((200, dimension)), random.random((30, dimension)) + 0.5
    np.testing.assert_array_equal(within_reach(points, others, 0.1), close(points, others, 0.1).any(axis=1))
    assert not within_reach(points, others[:0], 0.1).any()


def test_stable_order_of_large_keys():
    keys = np.random.default_rng(0).integers(0, 2**62, 5000)
    keys[::7] = keys[0]
    np.testing.assert_array_equal(stable_order(keys.copy()), np.argsort(keys, kind="stable"))


@pytest.mark.parametrize(
    "points, owned, reach, word",
    [
        (np.zeros(3), 0, 1.0, "points"),
        (np.zeros((3, 4)), 0, 1.0, "points"),
        (np.array([[0.0], [np.nan]]), 2, 1.0, "points"),
        (np.array([[0.0], [np.inf]]), 1, 1.0, "points"),
        (np.zeros((3, 2)), 4, 1.0, "owned"),
        (np.zeros((3, 2)), -1, 1.0, "owned"),
        (np.zeros((3, 2)), 3, 0.0, "reach"),
        (np.zeros((3, 2)), 3, np.nan, "reach"),
    ],
)
def test_wrong_arguments_of_half_pairs_are_named(points, owned, reach, word):
    with pytest.raises(ValueError, match=f"^{word}: expected"):
        half_pairs(points, owned, reach)


def test_pairs_of_boxes_are_those_of_all():
    rng = np.random.default_rng(3)
    lower = rng.uniform(0.0, 10.0, (300, 3))
    upper = lower + rng.uniform(0.0, 2.0, (300, 3))
    for distance in (0.0, 0.3, np.inf):
        first, second = close_boxes(lower, upper, distance)
        gap = np.maximum(lower[:, None] - upper, lower - upper[:, None]).max(axis=2)
        wanted = np.argwhere(np.triu(gap <= distance, 1))
        order = np.lexsort((second, first))
        np.testing.assert_array_equal(np.stack((first, second), axis=1)[order], wanted)
