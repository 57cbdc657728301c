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
    cells = np.array([[0], [1], [2]])
    for weight, left in (([1, 8, 3], 2), ([5, 4, 3], 1), ([2, 3, 7], 2), ([10, 1, 1], 1), ([3, 8, 1], 1)):
        tree = cut_cells(_TwoRanks, cells, np.array(weight))
        assert np.count_nonzero(tree.owners(cells) == 0) == left, weight
