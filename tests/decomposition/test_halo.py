"""Ghosts against brute force, and the exchanges between owners and ghosts."""

import gc

import numpy as np
import pytest
from point_sets import KINDS, close, lattice, point_set, share

from decomposition.bisection import bisect
from decomposition.halo import Halo
from decomposition.migration import migrate
from decomposition.pair_search import half_pairs

REACH = 0.25


def distribute(comm, points, how):
    """This rank's points and their numbers: dealt out in turn, or by bisection."""
    numbers = share(comm, len(points))
    mine = {"points": points[numbers], "numbers": numbers}
    if how == "bisected":
        mine = migrate(comm, bisect(comm, mine["points"]), mine)
    return mine["points"], mine["numbers"]


def expected_ghosts(comm, points, mine, reach):
    """Numbers of the points of other ranks within reach, by rank and row."""
    ghosts = [np.empty(0, np.int64)]
    for rank, numbers in enumerate(comm.allgather(mine)):
        if rank != comm.rank:
            ghosts.append(numbers[close(points[numbers], points[mine], reach).any(axis=1)])
    return np.concatenate(ghosts)


@pytest.mark.parametrize("how", ["dealt", "bisected"])
@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_ghosts_equal_brute_force(comm, kind, dimension, how):
    points = point_set(kind, dimension)
    place, numbers = distribute(comm, points, how)
    halo = Halo(comm, place, REACH)
    expected = expected_ghosts(comm, points, numbers, REACH)
    assert (halo.owned, halo.ghosts) == (len(numbers), len(expected))
    np.testing.assert_array_equal(halo.with_ghosts(numbers), np.concatenate((numbers, expected)))
    owners = np.empty(len(points), np.int64)
    for rank, theirs in enumerate(comm.allgather(numbers)):
        owners[theirs] = rank
    found = np.repeat(halo.plan.neighbours, [len(rows) for rows in halo.plan.receive_rows])
    np.testing.assert_array_equal(found, owners[expected])
    assert comm.rank not in halo.plan.neighbours and halo.plan.neighbours == sorted(halo.plan.neighbours)


def test_an_ell_shaped_part_has_no_ghosts_inside_its_box_only(comm):
    # rank 0 holds an L, the others what is in its notch, out of reach but for a corner
    points = lattice(20, 2)
    ell = (points[:, 0] < 0) | (points[:, 1] < 0)
    numbers = np.flatnonzero(ell) if comm.rank == 0 else np.flatnonzero(~ell)[comm.rank - 1 :: comm.size - 1]
    halo = Halo(comm, points[numbers], 1.5)
    expected = expected_ghosts(comm, points, numbers, 1.5)
    np.testing.assert_array_equal(halo.with_ghosts(numbers)[len(numbers) :], expected)
    if comm.rank == 0 and comm.size > 1:
        assert halo.ghosts == 19


def test_pairs_over_ranks_equal_those_of_one(comm):
    points = point_set("lattice", 3)
    place, numbers = distribute(comm, points, "bisected")
    halo = Halo(comm, place, 0.3)
    everyone = halo.with_ghosts(numbers)
    start, neighbour = half_pairs(halo.with_ghosts(place), halo.owned, 0.3)
    row = np.repeat(np.arange(halo.owned), np.diff(start))
    pairs = np.sort(np.stack((everyone[row], everyone[neighbour])), axis=0)
    within = neighbour < halo.owned
    once = np.concatenate(comm.allgather(pairs[:, within]), axis=1)
    twice = np.unique(np.concatenate(comm.allgather(pairs[:, ~within]), axis=1), axis=1)
    assert 2 * twice.shape[1] == comm.allreduce(np.count_nonzero(~within))
    found = np.concatenate((once, twice), axis=1)
    start, neighbour = half_pairs(points, len(points), 0.3)
    expected = np.stack((np.repeat(np.arange(len(points)), np.diff(start)), neighbour))
    np.testing.assert_array_equal(found[:, np.lexsort(found[::-1])], expected)


def views(rows):
    """Arrays of all kinds of strides, and what fills their rows for given numbers."""
    return [
        np.zeros(rows + 2),
        np.zeros((rows, 4))[:, :3],
        np.zeros((6, rows + 5)).T,
        np.zeros((rows, 3, 3))[:, ::2],
        np.zeros((2 * rows + 1, 2))[1::2],
        np.zeros(rows, np.int64),
    ]


def values(array, numbers):
    columns = np.arange(int(np.prod(array.shape[1:]))).reshape(array.shape[1:])
    return (np.multiply.outer(numbers, np.ones(array.shape[1:])) * 100 + columns).astype(array.dtype)


@pytest.mark.parametrize("how", ["dealt", "bisected"])
def test_exchange_of_arrays_of_any_strides(comm, how):
    points = point_set("random", 2)
    place, numbers = distribute(comm, points, how)
    halo = Halo(comm, place, REACH)
    everyone = halo.with_ghosts(numbers)
    arrays = views(len(everyone))
    exchange = halo.forward(*arrays)
    for sign in (1, -1):
        for array in arrays:
            array[: halo.owned] = values(array, sign * numbers)
        exchange.start()
        for array in arrays:
            # what travels has been copied
            array[: halo.owned] = 0
        exchange.finish()
        for array in arrays:
            found = array[halo.owned : len(everyone)]
            np.testing.assert_array_equal(found, values(array, sign * everyone[halo.owned :]))
            assert not array[: halo.owned].any() and not array[len(everyone) :].any()
    columns = sum(int(np.prod(array.shape[1:])) for array in arrays)
    assert exchange.bytes_sent == 8 * columns * sum(len(rows) for rows in halo.plan.send_rows)


def test_integers_travel_bit_by_bit(comm):
    place, numbers = distribute(comm, point_set("random", 2), "dealt")
    halo = Halo(comm, place, REACH)
    # as a double, this is a signalling NaN
    pattern = 0x7FF0000000000001
    everyone = halo.with_ghosts(numbers + pattern)
    np.testing.assert_array_equal(everyone - pattern, halo.with_ghosts(numbers))


@pytest.mark.parametrize("how", ["dealt", "bisected"])
def test_accumulate_is_the_adjoint_of_exchange(comm, how):
    place, numbers = distribute(comm, point_set("lattice", 2), how)
    halo = Halo(comm, place, REACH)
    everyone = halo.with_ghosts(numbers)
    arrays = [np.ones(len(everyone)), np.zeros((3, len(everyone))).T]
    arrays[1][:] = everyone[:, None]
    accumulate = halo.reverse(*arrays)
    accumulate.start()
    accumulate.finish()
    holders = np.bincount(np.concatenate(comm.allgather(everyone)), minlength=1)
    np.testing.assert_array_equal(arrays[0][: halo.owned], holders[numbers])
    np.testing.assert_array_equal(arrays[1][: halo.owned, 2], holders[numbers] * numbers)
    np.testing.assert_array_equal(arrays[1][halo.owned :, 0], everyone[halo.owned :])


def test_keep_drops_ghosts_on_both_sides(comm):
    place, numbers = distribute(comm, point_set("random", 3), "bisected")
    halo = Halo(comm, place, REACH)
    ghosts = halo.with_ghosts(numbers)[halo.owned :]
    for mask in (ghosts % 3 == 0, np.zeros(halo.ghosts, bool), np.ones(halo.ghosts, bool)):
        kept = halo.subset(mask)
        np.testing.assert_array_equal(kept.with_ghosts(numbers), np.concatenate((numbers, ghosts[mask])))
        if not mask.any() and not comm.allreduce(int(mask.any())):
            assert kept.plan.neighbours == []


def test_without_neighbours_an_exchange_costs_nothing(comm):
    halo = Halo(comm, np.full((3, 2), 100.0 * comm.rank), 1.0)
    assert halo.ghosts == 0 and halo.plan.neighbours == []
    exchange = halo.forward(np.zeros(3))
    exchange.start()
    exchange.finish()
    assert exchange.silent and exchange.bytes_sent == 0


@pytest.mark.slow
def test_many_plans_leave_no_requests_behind(comm):
    place, numbers = distribute(comm, point_set("random", 2), "dealt")
    # what was there before need not be looked at again
    gc.collect()
    gc.freeze()
    for _ in range(20):
        halo = Halo(comm, place, REACH)
        exchange = halo.forward(np.zeros(halo.owned + halo.ghosts))
        exchange.start()
        exchange.finish()
        requests = exchange.messages._finalizer.peek()[2][0]
        del exchange
        gc.collect()
        assert requests == []
    gc.unfreeze()


def test_a_freed_exchange_says_so(comm):
    halo = Halo(comm, np.zeros((2, 2)), 1.0)
    exchange = halo.forward(np.zeros(halo.owned + halo.ghosts))
    exchange.free()
    with pytest.raises(RuntimeError, match="freed"):
        exchange.start()


@pytest.mark.parametrize(
    "array, word",
    [
        (np.zeros(2), "at least 3 rows"),
        (np.zeros(3, np.float32), "8 bytes"),
        (np.zeros(3, ">f8"), "8 bytes"),
        (np.array([None] * 3), "8 bytes"),
        ([0.0, 0.0, 0.0], "array"),
        (np.broadcast_to(0.0, (3,)), "writeable"),
    ],
)
def test_wrong_arrays_are_named(comm, array, word):
    halo = Halo(comm, np.full((3, 2), 100.0 * comm.rank), 1.0)
    with pytest.raises(ValueError, match=rf"^arrays\[1\]: expected .*{word}"):
        halo.forward(np.zeros(3), array)


def test_integers_are_not_added(comm):
    halo = Halo(comm, np.full((3, 2), 100.0 * comm.rank), 1.0)
    with pytest.raises(ValueError, match="float64"):
        halo.reverse(np.zeros(3, np.int64))


def test_wrong_input_on_one_rank_raises_on_all(comm):
    last = comm.rank == comm.size - 1
    points = np.full((2, 2), np.nan if last else 0.0)
    with pytest.raises(ValueError, match="^points: expected finite"):
        Halo(comm, points, 1.0)
    with pytest.raises(ValueError, match="^reach: expected"):
        Halo(comm, np.zeros((2, 2)), -1.0 if last else 1.0)


@pytest.mark.ranks(2, 3)
def test_differing_reach_raises_on_all(comm):
    with pytest.raises(ValueError, match="expected the same dimension and reach on all ranks"):
        Halo(comm, np.zeros((2, 2)), 1.0 + comm.rank)
