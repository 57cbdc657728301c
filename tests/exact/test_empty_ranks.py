"""Sums that exact solutions ask for, on ranks without particles."""

import numpy as np

from parsolid.exact.solution import View


class Rows:
    """Particles of a rank, as `View` asks for them."""

    def __init__(self, count: int) -> None:
        self.volume = np.full(count, 0.5)

    def rows(self, name: str) -> np.ndarray:
        assert name == "volume"
        return self.volume


def test_sums_count_ranks_without_particles(comm):
    """All of 6 particles are on the last rank."""
    count = 6 if comm.rank == comm.size - 1 else 0
    values = np.ones(count), np.ones((count, 3)), np.ones((count, 2, 2))
    assert View(comm, Rows(count)).sums(*values).tolist() == [3.0, 9.0, 12.0]
