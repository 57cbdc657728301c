"""Rows arrive whole, in order, whatever their type and strides."""

import numpy as np
import pytest

from decomposition.migration import migrate


def arrays_of(identifier):
    wide = np.empty((6, len(identifier) + 3))
    wide[:, : len(identifier)] = identifier + np.arange(6)[:, None] / 8
    padded = np.repeat(identifier[:, None], 4, axis=1) / 2.0
    return {
        "identifier": identifier,
        "transposed": wide.T[: len(identifier)],
        "padded": padded[:, :3],
        "matrix": np.multiply.outer(identifier, np.arange(4.0).reshape(2, 2)),
        "flag": identifier % 2 == 0,
        "body": (identifier % 5).astype(np.int32),
        "nothing": np.empty((len(identifier), 0)),
    }


@pytest.mark.parametrize("count", [0, 1, 50])
def test_rows_arrive_in_the_order_of_source_and_row(comm, count):
    count = 0 if comm.rank == 1 else count
    identifier = 1000 * comm.rank + np.arange(count)
    owner = np.random.default_rng(comm.rank).integers(0, comm.size, count)
    result = migrate(comm, owner, arrays_of(identifier))
    everything = [ids[to == comm.rank] for ids, to in zip(comm.allgather(identifier), comm.allgather(owner))]
    expected = arrays_of(np.concatenate(everything))
    assert list(result) == list(expected)
    for name, array in result.items():
        assert array.dtype == expected[name].dtype and array.flags.c_contiguous
        np.testing.assert_array_equal(array, expected[name])


def test_all_to_one_and_back(comm):
    identifier = 10 * comm.rank + np.arange(7)
    origin = np.full(7, comm.rank, np.int32)
    last = comm.size - 1
    gathered = migrate(comm, np.full(7, last), {"identifier": identifier, "origin": origin})
    assert len(gathered["identifier"]) == (7 * comm.size if comm.rank == last else 0)
    back = migrate(comm, gathered["origin"], gathered)
    np.testing.assert_array_equal(back["identifier"], identifier)


def test_the_result_is_new(comm):
    array = np.arange(3.0)
    result = migrate(comm, np.full(3, comm.rank), {"array": array})["array"]
    result[:] = -1.0
    np.testing.assert_array_equal(array, np.arange(3.0))


@pytest.mark.parametrize(
    "owner, array, word",
    [
        ([0, 999], np.zeros(2), "owner"),
        ([0, -1], np.zeros(2), "owner"),
        ([0.0, 0.0], np.zeros(2), "owner"),
        ([0, 0], np.zeros(3), "arrays\\['array'\\]"),
        ([0, 0], np.array([None, None]), "arrays\\['array'\\]"),
    ],
)
def test_a_wrong_argument_on_one_rank_raises_on_all(comm, owner, array, word):
    if comm.rank == comm.size - 1:
        with pytest.raises(ValueError, match=f"^{word}: expected"):
            migrate(comm, np.array(owner), {"array": array})
    else:
        with pytest.raises(ValueError, match=f"rank {comm.size - 1} has arguments that are wrong there"):
            migrate(comm, np.array([0, 0]), {"array": np.zeros(2)})


@pytest.mark.ranks(2, 3)
def test_differing_kinds_of_rows_raise_on_all(comm):
    array = np.zeros((2, 3)) if comm.rank else np.zeros((2, 2))
    with pytest.raises(ValueError, match="expected the same on all ranks"):
        migrate(comm, np.zeros(2, np.int64), {"array": array})
