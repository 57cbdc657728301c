"""Balance, compactness and reproducibility of the bisection, on this run's ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from point_sets import KINDS, lattice, point_set, share

from decomposition.bisection import bisect, cut_points, keys_of, places_of


class _Rank0:
    """Pretends to be rank 0 of many ranks of which the others have no points."""

    rank = 0

    def __init__(self, size):
        self.size = size

    def Allreduce(self, send, receive, operation):
        assert send is MPI.IN_PLACE

    def Exscan(self, send, receive, operation):
        receive[:] = 99


def loads(comm, owner, weights=None):
    return comm.allreduce(np.bincount(owner, weights, minlength=comm.size))


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_parts_are_balanced_to_a_point(comm, kind, dimension):
    points = point_set(kind, dimension)[share(comm, len(point_set(kind, dimension)))]
    owner = bisect(comm, points)
    assert owner.dtype == np.int32 and owner.shape == (len(points),)
    counts = loads(comm, owner)
    assert counts.max() - counts.min() <= 1


@pytest.mark.serial
@pytest.mark.parametrize("ranks", [2, 3, 5, 7, 16, 37, 1000])
@pytest.mark.parametrize("kind", KINDS)
def test_any_number_of_ranks(kind, ranks):
    points = point_set(kind, 3)
    counts = np.bincount(bisect(_Rank0(ranks), points), minlength=ranks)
    assert counts.sum() == len(points) and len(counts) == ranks
    assert counts.max() - counts.min() <= 2


@pytest.mark.serial
def test_a_cube_is_cut_into_cubes():
    points = lattice(16, 3)
    owner = bisect(_Rank0(8), points)
    for rank in range(8):
        part = points[owner == rank]
        np.testing.assert_array_equal(part.max(axis=0) - part.min(axis=0), [7, 7, 7])


def test_the_longest_side_is_cut(comm):
    points = lattice(12, 2) * [1.0, 40.0]
    mine = points[share(comm, len(points))]
    owner = bisect(comm, mine)
    everything, owners = np.concatenate(comm.allgather(mine)), np.concatenate(comm.allgather(owner))
    for rank in range(comm.size - 1):
        assert everything[owners == rank][:, 1].max() <= everything[owners == rank + 1][:, 1].min()


def test_weights_are_balanced(comm):
    random = np.random.default_rng(comm.rank)
    points, weights = random.random((2000, 3)), random.random(2000) ** 4
    weight = loads(comm, bisect(comm, points, weights), weights)
    assert np.abs(weight - weight.mean()).max() <= 2.0
    heavy = np.where(points[:, 0] < 0.5, 3.0, 1.0)
    weight = loads(comm, bisect(comm, points, heavy), heavy)
    assert np.abs(weight - weight.mean()).max() <= 2 * 3.0


def test_zero_weights_count_as_none(comm):
    points = np.random.default_rng(comm.rank).random((100, 2))
    np.testing.assert_array_equal(bisect(comm, points, np.zeros(100)), bisect(comm, points))


def test_parts_do_not_depend_on_who_holds_a_point(comm):
    points = lattice(9, 3)
    one_way = share(comm, len(points))
    other_way = np.array_split(np.arange(len(points)), comm.size)[comm.rank]
    parts = []
    for rows in (one_way, other_way[::-1]):
        owner = np.zeros(len(points), np.int64)
        owner[rows] = bisect(comm, points[rows])
        parts.append(comm.allreduce(owner))
    np.testing.assert_array_equal(*parts)


def test_signed_zeros_are_one_place(comm):
    points = np.array([[0.0, 1.0], [-0.0, 0.0], [0.0, 2.0], [-0.0, 3.0]])[share(comm, 4)]
    owners = np.concatenate(comm.allgather(bisect(comm, points)))
    height = np.concatenate(comm.allgather(points[:, 1]))
    assert (np.diff(owners[np.argsort(height)]) >= 0).all()


@pytest.mark.parametrize("bad", [-1.0, np.nan, np.inf])
def test_a_wrong_weight_on_one_rank_raises_on_all(comm, bad):
    weights = np.ones(5)
    weights[2] = bad if comm.rank == comm.size - 1 else 1.0
    with pytest.raises(ValueError, match="^weights: expected"):
        bisect(comm, np.zeros((5, 3)), weights)


def test_a_wrong_point_on_one_rank_raises_on_all(comm):
    points = np.zeros((4, 2))
    points[1, 1] = np.nan if comm.rank == 0 else 0.0
    with pytest.raises(ValueError, match="^points: expected finite"):
        bisect(comm, points)


@pytest.mark.serial
def test_keys_are_in_the_order_of_coordinates_and_give_them_back():
    values = np.array([-np.inf, -1e308, -1.5, -1e-310, -0.0, 0.0, 5e-324, 1.0, np.nextafter(1.0, 2.0), np.inf])[:, None]
    keys = keys_of(values)
    np.testing.assert_array_equal(places_of(keys), values)
    assert keys[4] == keys[5] and (np.diff(np.delete(keys, 4)) > 0).all()


@pytest.mark.serial
@pytest.mark.parametrize("ranks", [1, 2, 7, 64])
def test_the_cuts_know_owners_and_neighbours(ranks):
    points = np.random.default_rng(ranks).random((600, 3))
    owner, tree = cut_points(_Rank0(ranks), points)
    np.testing.assert_array_equal(tree.owners(keys_of(points)), owner)
    gap = np.linalg.norm(points[:, None] - points[None], axis=2)
    for rank in range(min(ranks, 9)):
        box = tree.box(rank)
        assert ((points[owner == rank] >= box[0]) & (points[owner == rank] <= box[1])).all()
        near = set(owner[(gap[owner == rank] < 0.2).any(axis=0)].tolist()) - {rank}
        assert near <= set(tree.neighbours(rank, 0.2))
        assert all(rank in tree.neighbours(other, 0.2) for other in tree.neighbours(rank, 0.2))
