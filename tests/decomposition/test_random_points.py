"""Random points on any number of ranks: partition, migration and halo against the same thing done serially."""

import numpy as np
import pytest

hypothesis = pytest.importorskip("hypothesis")
from hypothesis import given  # noqa: E402 (after it is known to be there)
from hypothesis import strategies as st  # noqa: E402

from decomposition.halo import Halo  # noqa: E402

# every rank draws as many examples and takes rank 0's, for constants of modules that a rank has loaded are drawn, too;
# none looks for a smaller one while the others wait
TOGETHER = hypothesis.settings(
    derandomize=True, deadline=None, database=None, max_examples=40, phases=[hypothesis.Phase.generate]
)
POINTS = st.tuples(
    st.integers(0, 300), st.integers(1, 3), st.integers(0, 2**32 - 1), st.sampled_from(["any", "grid", "place", "line"])
)


def points_of(count: int, dimension: int, seed: int, kind: str) -> np.ndarray:
    chance = np.random.default_rng(seed)
    if kind == "place":
        return np.ones((count, dimension))
    points = chance.standard_normal((count, dimension)) * 10.0 ** chance.integers(-3, 4)
    if kind == "line":
        points[:, 1:] = 0.0
    # many ties
    return np.rint(4 * points) if kind == "grid" else points


def own(comm, count: int, seed: int) -> np.ndarray:
    """Which points this rank starts with: anything, some ranks may have none."""
    return np.flatnonzero(np.random.default_rng(seed + 1).integers(0, comm.size, count) == comm.rank)


@TOGETHER
@given(drawn=POINTS, reach=st.floats(0.01, 2.0))
def test_a_halo_has_the_ghosts_of_a_serial_model_and_adds_up_what_they_give(comm, drawn, reach):
    count, dimension, seed, kind = comm.bcast(drawn)
    # of the order of the spacing, whatever the scale is
    points, rows = points_of(count, dimension, seed, kind), own(comm, count, seed)
    reach = comm.bcast(reach) * max(float(np.std(points)) if count else 0.0, 0.1)
    halo = Halo(comm, points[rows], reach)
    expected = []
    for rank in range(comm.size):
        theirs = comm.bcast(rows, root=rank)
        if rank != comm.rank:
            square = ((points[theirs][:, None] - points[rows][None]) ** 2).sum(axis=2)
            expected += theirs[(square < reach * reach).any(axis=1)].tolist() if len(rows) else []
    everyone = halo.with_ghosts(rows)
    same = everyone[: len(rows)].tolist() == rows.tolist() and everyone[len(rows) :].tolist() == expected
    # all or none, for what follows is collective
    assert comm.allreduce(int(same)) == comm.size
    given_back = np.random.default_rng(seed + 3).standard_normal((comm.size, count, 2))
    values = given_back[comm.rank, everyone].copy()
    accumulate = halo.reverse(values)
    accumulate.start()
    accumulate.finish()
    held = comm.allgather(everyone)
    total = sum((given_back[rank, rows] * np.isin(rows, held[rank])[:, None] for rank in range(comm.size)), 0.0)
    assert np.abs(values[: len(rows)] - total).max(initial=0.0) <= 1e-14 * comm.size * 5.0
