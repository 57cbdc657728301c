"""A run that was stopped and restarted on the same ranks has the bits of one that was not."""

import pytest
from cases import cases
from run_results import assert_same_bits


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("name", cases())
def test_history_checkpoint_and_fields_are_the_same_to_the_last_bit(runs, comm, name):
    pieces, whole = runs.in_pieces(name), runs.whole(name)
    if comm.rank == 0:
        assert_same_bits(pieces.folder, whole.folder)
