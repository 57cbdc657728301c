"""Pairs and orders against brute force."""

import numpy as np
import pytest
from point_sets import KINDS, close, lattice, point_set

from decomposition import half_pairs, order_along_cells
from decomposition.cells import stable_order, within_reach

# on the lattice, whose spacing is 1 / 8, both reaches equal distances between points: the test must be strict
REACHES = [0.125, 0.25, 0.3]


def brute_force(points, owned, reach):
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
        expected_start, expected = brute_force(points, owned, reach)
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
    order = order_along_cells(points, 0.2)
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


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_order_along_cells_is_a_permutation_by_cells(kind, dimension):
    points = point_set(kind, dimension)
    order = order_along_cells(points, 0.25)
    np.testing.assert_array_equal(np.sort(order), np.arange(len(points)))
    if len(points) and kind != "clusters":
        cells = np.floor((points - points.min(axis=0)) / 0.25).astype(int)[order]
        changes = np.flatnonzero(np.diff(cells, axis=0).any(axis=1)) + 1
        # each cell once, points of a cell as they came
        assert len(changes) + 1 == len(np.unique(cells, axis=0))
        assert all((np.diff(piece) > 0).all() for piece in np.split(order, changes))


def test_order_along_cells_is_mortons():
    square = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [2, 0], [3, 0], [2, 1], [3, 1], [0, 2]]) + 0.5
    shuffled = np.random.default_rng(0).permutation(len(square))
    np.testing.assert_array_equal(square[shuffled][order_along_cells(square[shuffled], 1.0)], square)


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
def test_wrong_arguments_are_named(points, owned, reach, word):
    with pytest.raises(ValueError, match=f"^{word}: expected"):
        half_pairs(points, owned, reach)
