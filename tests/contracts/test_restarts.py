"""A run that was stopped and restarted on the same ranks has the bits of one that was not."""

import pytest
from cases import cases, one_of_each_tag
from run_results import assert_same_bits

FEW = one_of_each_tag()


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.ranks(2, *(1,) * (name in FEW))) for name in cases()]
)
def test_history_checkpoint_and_fields_are_the_same_to_the_last_bit(runs, comm, name):
    """Of all scenes on two ranks, and on one rank of one scene a tag."""
    pieces, whole = runs.in_pieces(name), runs.whole(name)
    if comm.rank == 0:
        assert_same_bits(pieces.folder, whole.folder)
