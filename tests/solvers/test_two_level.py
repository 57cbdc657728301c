"""The grid of two levels: its stiffness by quadrature over particles, and its functions at particles."""

from itertools import product

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.solvers import Grid, TwoLevel
from parsolid.solvers.node_grid import shape_values


def grid_over(comm, d, size=(1.3, 0.5, 0.7)):
    """A grid, and particles on it that ranks share."""
    places = np.random.default_rng(4).uniform(size=(6**d + 20, d)) * size[:d]
    mine = places[comm.rank :: comm.size]
    return Grid.over(comm, mine, 0.3), mine, places


def quadrature(grid, places, lame, shear):
    """The stiffness (nodes d, nodes d) of all nodes, slope by slope."""
    d = places.shape[1]
    first, within = grid.within(places)
    result = np.zeros((grid.nodes, d, grid.nodes, d))
    for p in range(len(places)):
        slope = np.empty((1 << d, d))
        for (k, corner), i in product(enumerate(product((0, 1), repeat=d)), range(d)):
            factors = [
                (2 * c - 1) / grid.width[i] if a == i else abs(1 - c - within[p, a]) for a, c in enumerate(corner)
            ]
            slope[k, i] = np.prod(factors)
        at = first[p] + grid.corners
        for k, n in enumerate(at):
            for j, m in enumerate(at):
                a, b = slope[k], slope[j]
                block = lame[p] * np.outer(a, b) + shear[p] * (np.outer(b, a) + (a @ b) * np.eye(d))
                result[n, :, m] += block
    return result.reshape(grid.nodes * d, -1)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_stiffness_is_the_quadrature_over_particles(comm, d):
    grid, mine, places = grid_over(comm, d)
    moduli = np.random.default_rng(5).uniform(1.0, 2.0, (2, len(places)))
    free, held = np.ones(mine.shape, bool), np.zeros((grid.nodes, d), bool)
    held[0] = True
    free[: 1 + len(mine) // 20, 0] = False
    level, diagonal = TwoLevel(comm, grid, mine, free, held), 3.0 + mine
    level.of_moduli(*moduli[:, comm.rank :: comm.size], np.ones(len(mine)), diagonal)
    expected = quadrature(grid, places, *moduli)
    first, within = grid.within(mine)
    jump = np.zeros(expected.shape)
    for p, at in enumerate(first[:, None] + grid.corners):
        for i in np.flatnonzero(~free[p]):
            shape = shape_values(within[p : p + 1])[0]
            jump[np.ix_(at * d + i, at * d + i)] += diagonal[p, i] * np.outer(shape, shape)
    expected += comm.allreduce(jump)
    moving = np.flatnonzero(level.moving.ravel())
    found = level.stiffness.toarray()
    assert np.allclose(found, expected[np.ix_(moving, moving)], rtol=0.0, atol=1e-7 * np.abs(expected).max())
    assert not level.moving[0].any()
    # the preconditioner is what its parts say, and symmetric
    residual = np.random.default_rng(6).normal(size=places.shape)[comm.rank :: comm.size] * free
    P = np.kron(level.prolongation.toarray(), np.eye(d))[:, moving]
    coarse = np.linalg.solve(found, comm.allreduce(P.T @ residual.ravel()))
    wanted = residual / diagonal + (P @ coarse).reshape(residual.shape) * free
    # what hardly any particle holds makes A's condition 1e8
    assert np.allclose(level(residual), wanted, rtol=0.0, atol=1e-7 * np.abs(wanted).max())


def test_the_longest_axis_is_the_slowest():
    """So that a long body has few numbers between the nodes of a cell."""
    grid = Grid(np.zeros(3), np.ones(3), np.array([3, 20, 5]), np.array([1, 24, 4]))
    assert [*Grid.over(MPI.COMM_SELF, np.array([[0.0, 0, 0], [3, 20, 5]]), 1.0).strides] == [*grid.strides]
    assert np.array_equal(grid.numbers @ grid.strides, np.arange(grid.nodes))
