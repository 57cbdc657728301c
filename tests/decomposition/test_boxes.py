"""Cuts of boxes along lattice planes, the owners of their nodes and the links between parts."""

import numpy as np
import pytest

from decomposition.boxes import BoxOfNodes, cut_boxes, links_of, owners, with_ghosts


def box(shape, lower=(0.0, 0.0, 0.0), ends=None):
    places = tuple(low + np.arange(float(n)) for low, n in zip(lower, shape))
    axes = tuple(int(k) for k in np.argsort([-n for n in shape], kind="stable"))
    return BoxOfNodes(places, axes, ends or tuple((4, 4) for _ in shape))


@pytest.mark.parametrize("shape", [(24, 24, 24), (65, 9, 9), (9, 100, 100), (40, 7), (5, 5, 5), (8, 8, 8)])
@pytest.mark.parametrize("ranks", [1, 2, 3, 4, 7, 16])
def test_every_node_has_one_owner_and_parts_are_thick_enough(shape, ranks):
    one = box(shape)
    parts = cut_boxes([one], ranks)[0]
    owner = owners(parts, one.axes, list(np.indices(shape).reshape(len(shape), -1)))
    assert owner.min() >= 0 and owner.max() < ranks
    counts = np.bincount(owner, minlength=ranks)
    assert counts.sum() == np.prod(shape)
    for lower, upper in parts[(parts[:, 0] < parts[:, 1]).all(axis=1)]:
        for k in range(len(shape)):
            whole = lower[k] == 0 and upper[k] == one.shape[k]
            end = lower[k] == 0 or upper[k] == one.shape[k]
            assert whole or (k < 2 and upper[k] - lower[k] >= (4 if end else 2))


@pytest.mark.parametrize(("shape", "ranks"), [((24, 24, 24), 2), ((24, 24, 24), 4), ((64, 16, 16), 8), ((64, 64), 16)])
def test_parts_have_equal_loads_where_planes_allow_it(shape, ranks):
    parts = cut_boxes([box(shape)], ranks)[0]
    nodes = np.prod(parts[:, 1] - parts[:, 0], axis=1)
    assert nodes.min() == nodes.max()


def test_bodies_apart_stay_whole():
    pair = [box((9, 9, 9)), box((9, 9, 9), lower=(20.0, 0.0, 0.0))]
    parts = cut_boxes(pair, 2)
    nodes = np.prod(parts[:, :, 1] - parts[:, :, 0], axis=2)
    assert sorted(nodes.tolist()) == [[0, 729], [729, 0]]


def test_several_bodies_are_balanced_together():
    three = [box((16, 16, 16), lower=(20.0 * i, 0.0, 0.0)) for i in range(3)]
    parts = cut_boxes(three, 4)
    nodes = np.prod(parts[:, :, 1] - parts[:, :, 0], axis=2).sum(axis=0)
    assert nodes.sum() == 3 * 16**3
    assert nodes.max() <= 1.15 * nodes.mean()


def test_a_scene_without_boxes_has_no_parts():
    assert cut_boxes([], 3).shape[:2] == (0, 3)


@pytest.mark.parametrize("ranks", [2, 3, 4, 6])
@pytest.mark.parametrize("shape", [(24, 20, 6), (30, 31)])
def test_ghosts_of_own_rows_and_columns_come_from_their_owners(ranks, shape):
    """What links carry fills every node that is within two steps along one axis, and only from inside its owner."""
    one = box(shape)
    parts = cut_boxes([one], ranks)[0]
    arrays = []
    row = one.shape[2] if len(shape) > 2 else 1
    for rank in range(ranks):
        lower, upper = with_ghosts(parts, rank, one.shape)
        number = np.full((upper[0] - lower[0], (upper[1] - lower[1]) * row), -1)
        inside = parts[rank] - lower
        whole = np.arange(np.prod(one.shape)).reshape(one.shape)
        own = whole[tuple(slice(*span) for span in parts[rank].T)]
        number[inside[0, 0] : inside[1, 0], inside[0, 1] * row : inside[1, 1] * row] = own.reshape(own.shape[0], -1)
        arrays.append(number)
    for rank in range(ranks):
        for link in links_of(parts, rank, one.shape):
            back = [other for other in links_of(parts, link.rank, one.shape) if other.rank == rank]
            assert len(back) == 1 and back[0].axis == link.axis
            arrays[rank][link.outside[2]] = arrays[link.rank][back[0].inside[2]]
    for rank in range(ranks):
        lower, upper = with_ghosts(parts, rank, one.shape)
        whole = np.arange(np.prod(one.shape)).reshape(one.shape)
        expected = whole[tuple(slice(a, b) for a, b in zip(lower, upper))].reshape(arrays[rank].shape)
        own = parts[rank] - lower
        planes, nodes = slice(own[0, 0], own[1, 0]), slice(own[0, 1] * row, own[1, 1] * row)
        assert np.array_equal(arrays[rank][planes], expected[planes])
        assert np.array_equal(arrays[rank][:, nodes], expected[:, nodes])
