"""What lies at the end of a range: a rank that there is not, and the bin at which a cut comes nearest to its target."""

import numpy as np
import pytest

from decomposition import migrate
from decomposition.cell_partition import _place


def test_the_rank_after_the_last_is_none(comm):
    with pytest.raises(ValueError, match=f"owner: expected ranks 0 to {comm.size - 1}, found {comm.size} to"):
        migrate(comm, np.array([comm.size]), {"array": np.zeros(1)})


@pytest.mark.serial
def test_a_cut_comes_nearest_to_its_target():
    weight = np.array([4, 4, 4])
    assert [_place(weight, target, nearest=True) for target in (1, 2, 5, 6, 7, 12, 13)] == [0, 1, 1, 2, 2, 3, 3]
    # what is left of the target is for the next axis, in the bin that is cut
    assert [_place(weight, target, nearest=False) for target in (1, 4, 7, 12, 13)] == [0, 1, 1, 2, 2]
