"""What lies at the end of a range: a rank that there is not, and the cell where a cut comes nearest to its target."""

import numpy as np
import pytest

from decomposition.bisection import cut_cells
from decomposition.migration import migrate


def test_the_rank_after_the_last_is_none(comm):
    with pytest.raises(ValueError, match=f"owner: expected ranks 0 to {comm.size - 1}, found {comm.size} to"):
        migrate(comm, np.array([comm.size]), {"array": np.zeros(1)})


class _TwoRanks:
    """One rank that cuts for two."""

    size, rank = 2, 0

    @staticmethod
    def Allreduce(send, receive, operation):
        pass


@pytest.mark.serial
def test_a_cut_comes_nearest_to_its_target():
    cells, weight = np.array([[0], [1], [2]]), np.array([4, 4, 4])
    for share, left in ((1 / 12, 0), (2 / 12, 1), (5 / 12, 1), (6 / 12, 2), (7 / 12, 2), (1.0, 3)):
        tree = cut_cells(_TwoRanks, cells, weight, np.array([share, 1.0 - share]))
        assert np.count_nonzero(tree.owners(cells) == 0) == left, share
