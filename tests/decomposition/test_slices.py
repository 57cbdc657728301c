"""Numbers that ranks keep in slices: everyone knows the keeper, and what is asked for comes back in order."""

import numpy as np
import pytest

from decomposition.slices import Slices, count_before


@pytest.mark.parametrize("count", [0, 1, 2, 7, 100])
def test_every_number_has_one_keeper(comm, count):
    slices = Slices(comm, count)
    mine = np.flatnonzero(slices.keepers(np.arange(count)) == comm.rank)
    np.testing.assert_array_equal(mine, np.arange(slices.first, slices.last))
    assert comm.allreduce(len(slices)) == count
    assert count_before(comm, len(slices)) == (slices.first, count)


@pytest.mark.parametrize("ranks", [1, 3, 4096])
def test_keepers_of_many_ranks(comm, ranks):
    class Comm:
        rank, size = 0, ranks

    slices = Slices(Comm, 10**9 + 7)
    for rank in {0, ranks // 2, ranks - 1}:
        first, last = slices.bounds(rank)
        np.testing.assert_array_equal(slices.keepers(np.array([first, last - 1])), rank)


@pytest.mark.parametrize("count", [1, 40])
def test_rows_come_to_their_keepers(comm, count):
    slices = Slices(comm, count)
    everything = [np.random.default_rng(rank).integers(0, count, 5 * rank + 3) for rank in range(comm.size)]
    come = slices.deliver(everything[comm.rank], value=10.0 * everything[comm.rank] + comm.rank)
    wanted = [(n, 10.0 * n + rank) for rank, numbers in enumerate(everything) for n in numbers]
    wanted = [(n - slices.first, value) for n, value in wanted if slices.first <= n < slices.last]
    assert list(zip(come["number"], come["value"])) == wanted


@pytest.mark.parametrize("count", [1, 40])
def test_answers_come_back_in_order(comm, count):
    slices = Slices(comm, count)
    numbers = np.random.default_rng(comm.rank).integers(0, count, 7 * (comm.rank % 2) + 2)
    kept = np.stack([np.arange(slices.first, slices.last), np.full(len(slices), comm.rank)], axis=1)
    fetched = slices.fetch(numbers, kept)
    np.testing.assert_array_equal(fetched, np.stack([numbers, slices.keepers(numbers)], axis=1))
    doubled = slices.ask(numbers, lambda asked: 2 * (asked["number"] + slices.first) + asked["more"], more=numbers % 3)
    np.testing.assert_array_equal(doubled, 2 * numbers + numbers % 3)
