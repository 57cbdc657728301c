"""Plans of rows that ranks share, and arrays of any length between some ranks."""

import numpy as np
import pytest

from decomposition.plan import Plan, send_to_some, swap


def shared_rows(comm, count=40):
    """Every rank has some of `count` rows; a plan of those that two ranks have, and the numbers of the own ones."""
    has = [np.flatnonzero(np.random.default_rng(rank).random(count) < 0.6) for rank in range(comm.size)]
    mine, others = has[comm.rank], [rank for rank in range(comm.size) if rank != comm.rank]
    rows = [np.searchsorted(mine, np.intersect1d(mine, has[rank])) for rank in others]
    return Plan(comm, others, rows, rows), has


def test_sums_have_the_same_bits_on_all_ranks(comm):
    plan, has = shared_rows(comm)
    given = [np.random.default_rng(10 + rank).standard_normal((40, 5)) for rank in range(comm.size)]
    array = given[comm.rank][has[comm.rank]]
    total = plan.sum(array[:, 1:4])
    for _ in range(2):
        array[:] = given[comm.rank][has[comm.rank]]
        total.now()
        expected = np.zeros((40, 5))
        for rank in range(comm.size):
            expected[has[rank]] += given[rank][has[rank]]
        np.testing.assert_array_equal(array[:, 1:4], expected[has[comm.rank], 1:4])
        np.testing.assert_array_equal(array[:, [0, 4]], given[comm.rank][has[comm.rank]][:, [0, 4]])


def test_the_largest_of_each_number_is_found(comm):
    plan, has = shared_rows(comm)
    given = [np.random.default_rng(10 + rank).standard_normal((40, 2)) for rank in range(comm.size)]
    array = given[comm.rank][has[comm.rank]]
    plan.largest(array).now()
    for row, values in zip(has[comm.rank], array):
        np.testing.assert_array_equal(
            values, np.max([given[r][row] for r in range(comm.size) if row in has[r]], axis=0)
        )


def test_ranks_that_know_each_other_swap_arrays_of_any_length(comm):
    others = [rank for rank in range(comm.size) if rank != comm.rank]
    come = swap(comm, others, [np.full((comm.rank * rank, 2), comm.rank) for rank in others])
    assert [array.shape for array in come] == [(comm.rank * rank, 2) for rank in others]
    assert all((array == rank).all() for rank, array in zip(others, come))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_arrays_arrive_from_ranks_that_are_not_expected(comm, share):
    for turn in range(30):
        # one round after the other, without a barrier in between
        talks = np.random.default_rng(turn).random((comm.size, comm.size)) < share
        np.fill_diagonal(talks, False)
        targets = np.flatnonzero(talks[comm.rank]).tolist()
        arrays = [np.full(turn % 4 + rank, 100 * turn + comm.rank) for rank in targets]
        sources, come = send_to_some(comm, targets, arrays, np.empty(0, np.int64))
        assert sources == np.flatnonzero(talks[:, comm.rank]).tolist()
        for source, array in zip(sources, come):
            np.testing.assert_array_equal(array, np.full(turn % 4 + comm.rank, 100 * turn + source))


@pytest.mark.parametrize("count", [3, 40_000])
def test_messages_under_way_at_once_are_told_apart_by_their_order(comm, count):
    """Exchanges of one size, finished in another order on each rank; some ranks make theirs anew now and then."""
    ranks = [rank for rank in range(comm.size) if rank != comm.rank]
    theirs = [np.arange(count * (k + 1), count * (k + 2)) for k in range(len(ranks))]
    plan = Plan(comm, ranks, [np.arange(count)] * len(ranks), theirs)
    arrays = [np.zeros((plan.capacity, 2)) for _ in range(4)]
    exchanges = [plan.forward(array) for array in arrays]
    random = np.random.default_rng(comm.rank)
    for turn in range(12):
        for number, array in enumerate(arrays):
            array[:count] = 1000.0 * turn + 100.0 * number + comm.rank
            if random.random() < 0.3:
                exchanges[number].free()
                exchanges[number] = plan.forward(array)
            exchanges[number].start()
        for number in random.permutation(len(arrays)):
            exchanges[number].finish()
        for number, array in enumerate(arrays):
            for rank, rows in zip(ranks, theirs):
                assert (array[rows] == 1000.0 * turn + 100.0 * number + rank).all()
