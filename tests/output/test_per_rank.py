"""Numbers of ranks in a state: written without being gathered, the rank's own or all on the first when read."""

import json

import numpy as np
import pytest

from parsolid.output.checkpoint import read_checkpoint, write_checkpoint
from parsolid.per_rank import PerRank, join_per_rank, own_share, split_per_rank


def test_states_keep_the_numbers_of_their_ranks(comm, shared_path):
    state = {"a": [1, {"b": PerRank(comm.rank, 0.1 + comm.rank)}], "c": PerRank(-1.0), "d": None}
    without, numbers = split_per_rank(state)
    assert json.loads(json.dumps(without)) == without and len(numbers) == 3
    write_checkpoint(comm, shared_path / "c.h5", without, [{"x": np.arange(3.0)}], np.array(numbers))
    header, _, rows = read_checkpoint(comm, shared_path / "c.h5")
    found = join_per_rank(header, rows)
    ranks = np.arange(comm.size)
    np.testing.assert_array_equal(found["a"][1]["b"], np.stack([ranks, 0.1 + ranks], axis=1))
    np.testing.assert_array_equal(found["c"], -np.ones((comm.size, 1)))
    assert found["d"] is None and found["a"][0] == 1


@pytest.mark.parametrize("written", [1, 2, 3, 4])
def test_sums_are_kept_on_other_ranks(comm, written):
    rows = np.arange(2.0 * written).reshape(written, 2)
    share = own_share(comm, rows)
    np.testing.assert_array_equal(comm.allreduce(share), rows.sum(axis=0))
    if written == comm.size:
        np.testing.assert_array_equal(share, rows[comm.rank])
