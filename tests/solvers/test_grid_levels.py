"""The hierarchy of grids: what its functions represent, its symmetry, and iterations that do not grow."""

from itertools import pairwise, product

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from parsolid.solvers import GridLevels, conjugate_gradients
from parsolid.solvers.grid_levels import turns

LAME, SHEAR = 0.58, 0.38


def brick(d):
    """Stiffness (2^d d, 2^d d) of a linear element of unit sides."""
    corners = np.array(list(product((0, 1), repeat=d)))
    K = np.zeros((2**d, d, 2**d, d))
    for place in product((0.5 - 0.5 / 3**0.5, 0.5 + 0.5 / 3**0.5), repeat=d):
        factors = np.where(corners, place, 1.0 - np.array(place))
        slopes = np.stack([np.prod(np.delete(factors, i, 1), axis=1) * (2 * corners[:, i] - 1) for i in range(d)], 1)
        K += 0.5**d * LAME * np.einsum("ai,bj->aibj", slopes, slopes)
        K += 0.5**d * SHEAR * np.einsum("aj,bi->aibj", slopes, slopes)
        K += 0.5**d * SHEAR * np.einsum("ak,bk,ij->aibj", slopes, slopes, np.eye(d))
    return K.reshape(2**d * d, -1)


def block(counts):
    """Places (n, d) of the nodes of unit elements, and their stiffness (n d, n d)."""
    d, strides = len(counts), np.append(np.cumprod(counts[:0:-1])[::-1], 1)
    cells = np.array(list(np.ndindex(*(np.array(counts) - 1))))
    at = (cells[:, None] + np.array(list(product((0, 1), repeat=d)))) @ strides
    at = (at[:, :, None] * d + np.arange(d)).reshape(len(cells), -1)
    rows, columns = np.broadcast_arrays(at[:, :, None], at[:, None])
    entries = np.broadcast_to(brick(d), rows.shape)
    size = int(np.prod(counts)) * d
    K = sparse.coo_array((entries.ravel(), (rows.ravel(), columns.ravel())), (size, size)).tocsr()
    return np.array(list(np.ndindex(*counts)), float), K


def on_ranks(comm, counts, clamped=True):
    """(own places, K's product, free components, diagonal) where planes of the longest axis are of one rank."""
    X, K = block(counts)
    d, axis = X.shape[1], int(np.argmax(counts))
    of = (X[:, axis] * comm.size // counts[axis]).astype(int)
    own, order = of == comm.rank, np.argsort(of, kind="stable")
    back = np.argsort(order, kind="stable")

    def apply(u, out):
        whole = np.concatenate(comm.allgather(u))[back]
        out[:] = (K @ whole.ravel()).reshape(-1, d)[own]

    free = np.ones(X.shape, bool)
    free[X[:, axis] == 0.0] = not clamped
    return X[own], apply, free[own], K.diagonal().reshape(-1, d)[own]


def levels_of(comm, places, free, diagonal):
    levels, one = GridLevels(comm, places, 1.0, free), np.ones(len(places))
    levels.of_moduli(LAME * one, SHEAR * one, one, diagonal)
    return levels


def iterations(comm, counts):
    places, apply, free, diagonal = on_ranks(comm, counts)
    levels = levels_of(comm, places, free, diagonal)
    load = np.zeros(places.shape)
    load[places[:, np.argmax(counts)] == max(counts) - 1.0, 0] = 1.0
    size = float(np.sqrt(comm.allreduce(np.vdot(load, load))))
    found = conjugate_gradients(comm, apply, load, 1e-6 * size, free, 300, levels)
    assert found.converged
    return found.iterations, len(levels.levels)


@pytest.mark.parametrize(
    "small, large", [((9, 17), (65, 129)), ((5, 7, 11), (13, 15, 33))], ids=["in the plane", "in space"]
)
def test_iterations_do_not_grow_with_the_body(comm, small, large):
    few, of_few = iterations(comm, small)
    many, of_many = iterations(comm, large)
    assert of_many > of_few
    assert many <= 1.5 * few


def test_a_slender_body_is_bent_without_being_sheared(comm):
    """A grid of one cell across: functions that cannot turn would take hundreds of iterations."""
    assert iterations(comm, (4, 60))[0] <= 45


@pytest.mark.parametrize("counts", [(4, 1500), (5, 9, 120)])
def test_cells_grow_twice_as_wide_but_across_one(comm, counts):
    places, _, free, diagonal = on_ranks(comm, counts)
    levels = levels_of(comm, places, free, diagonal)
    grids = [level.nodes for level in levels.levels] + [levels.coarsest.nodes]
    assert (grids[-1].cells == 1).any() and len(grids) > 1
    for finer, coarser in pairwise(grids):
        wider = [1 if cells == 1 else 2 for cells in finer.cells]
        assert list(coarser.width / finer.width) == wider
        assert list(coarser.cells) == [-(-cells // times) for cells, times in zip(finer.cells, wider)]


@pytest.mark.parametrize("counts", [(13, 30), (5, 6, 25)])
def test_it_is_symmetric_and_positive(comm, counts):
    places, _, free, diagonal = on_ranks(comm, counts)
    levels = levels_of(comm, places, free, diagonal)
    a, b = np.sin(places * 7.0 + 1.0) * free, np.cos(places**2) * free
    of_a, of_b = levels(a), levels(b)
    forth, back, square = comm.allreduce(np.array([np.vdot(a, of_b), np.vdot(b, of_a), np.vdot(a, of_a)]))
    assert forth == pytest.approx(back, rel=1e-9)
    assert square > 0.0
    assert not of_a[~free].any()


@pytest.mark.parametrize("d", [1, 2, 3])
def test_every_grid_turns_rigidly(comm, d):
    """Nodes that all move and turn as one give the motion of a rigid body, on the particles and from grid to grid."""
    counts = {1: (700,), 2: (40, 60), 3: (13, 18, 41)}[d]
    places, _, free, diagonal = on_ranks(comm, counts, clamped=False)
    levels = levels_of(comm, places, free, diagonal)
    shift, spin = (
        np.array([0.3, -0.2, 0.5])[:d],
        np.tensordot(np.array([0.7, 0.4, -0.6])[: d * (d - 1) // 2], turns(d), 1),
    )

    def of_nodes(nodes):
        turn = np.array([0.7, 0.4, -0.6])[: d * (d - 1) // 2] * nodes.width.max()
        return np.hstack(
            (shift + (nodes.lower + nodes.numbers * nodes.width) @ spin.T, np.tile(turn, (len(nodes.keys), 1)))
        )

    grids = [level.nodes for level in levels.levels] + [levels.coarsest.nodes]
    assert len(grids) > 1
    found = (levels.prolongation @ of_nodes(grids[0]).ravel()).reshape(places.shape)
    assert found == pytest.approx(shift + places @ spin.T, abs=1e-11)
    for level, finer, coarser in zip(levels.levels, grids, grids[1:]):
        assert level.from_coarser @ of_nodes(coarser).ravel() == pytest.approx(of_nodes(finer).ravel(), abs=1e-10)


def test_a_rank_keeps_nodes_of_its_own_particles_alone(comm):
    """No rank has the whole finest grid of a long body, and the coarsest one is small."""
    places, _, free, diagonal = on_ranks(comm, (5, 5, 400))
    levels = levels_of(comm, places, free, diagonal)
    mine, total = len(levels.nodes.keys), 4 * 101
    assert mine <= total / comm.size + 8
    assert len(levels.coarsest.factors) <= 150 * 6


def test_grids_do_not_depend_on_ranks(comm):
    """As many grids, the same coarsest one, and the same motions, whatever nodes are on several ranks."""
    found = []
    for one in (comm, MPI.COMM_SELF):
        places, _, free, diagonal = on_ranks(one, (5, 6, 150))
        levels = levels_of(one, places, free, diagonal)
        found.append((levels, places, levels(np.sin(places * 7.0 + 1.0) * free)))
    (levels, places, motions), (alone, every, expected) = found
    assert len(levels.levels) == len(alone.levels)
    assert len(levels.coarsest.factors) == len(alone.coarsest.factors)
    rows = np.lexsort(every.T)[np.searchsorted(np.sort(every @ (1, 5, 30)), places @ (1, 5, 30))]
    assert motions == pytest.approx(expected[rows], abs=1e-10 * np.abs(expected).max())
