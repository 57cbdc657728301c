"""Cells, shared nodes and moving particles on any number of ranks, against sums done by one rank with numpy."""

from types import SimpleNamespace

import numpy as np
import pytest

from decomposition.bisection import CutTree, cut_cells
from decomposition.grid import RankGrid
from decomposition.occupied import Mirror, OccupiedCells, indices_of, with_neighbours, words
from decomposition.shared_nodes import SharedNodes

WIDTH = 3


class Particles:
    """Points with a name and a weight that give to the nodes of their cell's stencil in unequal parts."""

    def __init__(self, position, name):
        self.position, self.name, self.owned = position, name, len(name)

    def bases(self):
        return np.floor(self.position)

    def packed(self, rows):
        return np.column_stack((self.position[rows], self.name[rows].astype(float)))

    def remove(self, rows):
        self._keep(np.delete(self.position, rows, axis=0), np.delete(self.name, rows))

    def insert(self, packed):
        name = np.concatenate((self.name, packed[:, -1].astype(np.int64)))
        self._keep(np.concatenate((self.position, packed[:, :-1])), name)

    def _keep(self, position, name):
        self.position, self.name, self.owned = position, name, len(name)


def particle_set(comm, dimension, count=400, seed=3):
    """The same particle_set on any number of ranks, dealt out in turn."""
    random = np.random.default_rng(seed)
    position = random.random((count, dimension)) * np.array([17.0, 9.0, 5.0])[:dimension] - 3.0
    mine = np.arange(comm.rank, count, comm.size)
    return Particles(position[mine], mine)


def given(name, size):
    """What a particle gives to each node of its stencil (n, size, 2).

    Bits that sums in another order would not keep.
    """
    return np.sin(np.outer(name, np.arange(1.0, size + 1)))[:, :, None] * np.array([1.0, 1e-3])


def scatter(grid, particles):
    """Sums (nodes, 4) of this rank's particles, cell by cell, in columns 1 and 2."""
    cells, size = grid.cells, grid.cells.stencil.shape[1]
    result = np.zeros((len(cells.nodes), 4))
    for c in range(len(cells.index)):
        local = np.zeros((size, 2))
        for p in cells.order[cells.start[c] : cells.start[c + 1]]:
            local += given(particles.name[p : p + 1], size)[0]
        result[cells.stencil[c], 1:3] += local
    return result


def totals(position, name, dimension):
    """Node index -> sum, by one rank."""
    size = WIDTH**dimension
    offsets = np.stack(np.meshgrid(*[np.arange(WIDTH)] * dimension, indexing="ij"), -1).reshape(-1, dimension)
    nodes = (np.floor(position).astype(int)[:, None] + offsets).reshape(-1, dimension)
    unique, back = np.unique(nodes, axis=0, return_inverse=True)
    sums = np.zeros((len(unique), 2))
    np.add.at(sums, back.ravel(), given(name, size).reshape(-1, 2))
    return {tuple(node): total for node, total in zip(unique, sums)}


def summed(grid, particles):
    """Node values (nodes, 4) after the sum over ranks."""
    nodes = scatter(grid, particles)
    grid.shared.sum(nodes[:, 1:3]).now()
    return nodes


def check_sums(comm, grid, particles):
    nodes = summed(grid, particles)
    everyone = comm.allgather((particles.position, particles.name))
    position, name = (np.concatenate(arrays) for arrays in zip(*everyone))
    wanted = totals(position, name, grid.dimension)
    found = [wanted.get(tuple(node), np.zeros(2)) for node in grid.cells.nodes]
    np.testing.assert_allclose(nodes[:, 1:3], np.array(found).reshape(-1, 2), rtol=0.0, atol=1e-13)
    touched = grid.cells.stencil[grid.cells.occupied]
    assert {tuple(node) for node in grid.cells.nodes[np.unique(touched)]} <= set(wanted)
    assert np.array_equal(np.sort(name), np.arange(len(name)))
    if not grid.slack:
        assert (grid.partition.owners(particles.bases().astype(np.int64)) == comm.rank).all()


@pytest.mark.parametrize("dimension", [2, 3])
def test_words_keep_the_order_and_the_indices(dimension):
    index = np.random.default_rng(1).integers(-5000, 5000, (300, dimension))
    word = words(index)
    np.testing.assert_array_equal(indices_of(word, dimension), index)
    np.testing.assert_array_equal(np.argsort(word, kind="stable"), np.lexsort(index.T[::-1]))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("parts", [1, 2, 3, 7])
def test_parts_are_equal_and_every_cell_has_one_owner(dimension, parts):
    class Ranks:
        """One rank that cuts for many."""

        size, rank = parts, 0

        @staticmethod
        def Allreduce(send, receive, operation):
            pass

    index = np.unique(np.random.default_rng(2).integers(-9, 12, (500, dimension)), axis=0)
    weights = np.random.default_rng(3).integers(1, 9, len(index))
    partition = cut_cells(Ranks, index, weights)
    owner = partition.owners(index)
    load = np.bincount(owner, weights, minlength=parts)
    assert load.max() - load.min() <= 4 * weights.max()
    again = CutTree.from_state(partition.state(), dimension)
    far = np.array([[-(10**6)] * dimension, [10**6] * dimension])
    np.testing.assert_array_equal(
        again.owners(np.concatenate((index, far))), partition.owners(np.concatenate((index, far)))
    )
    boxes = np.array([partition.box(rank) for rank in range(parts)])
    assert ((boxes[owner, 0] <= index) & (index <= boxes[owner, 1])).all()
    # every rank that owns a cell of a node's neighbourhood is named, and is a neighbour of the owner
    nodes = index[:40]
    offsets = np.stack(np.meshgrid(*[np.arange(WIDTH)] * dimension, indexing="ij"), -1).reshape(-1, dimension)
    for here in range(parts):
        named = partition.touching(nodes, WIDTH, here)
        for row, node in enumerate(nodes):
            true = set(partition.owners(node - offsets).tolist()) - {here}
            assert true <= set(named[named[:, 0] == row, 1].tolist())
    for cell in index[:40]:
        here = int(partition.owners(cell[None])[0])
        near = set(partition.owners(cell + offsets - 1).tolist()) - {here}
        assert near <= set(partition.neighbours(here, 1))


@pytest.mark.parametrize("dimension", [2, 3])
def test_sums_over_ranks_while_particles_move(comm, dimension):
    particles = particle_set(comm, dimension)
    grid = RankGrid(comm, dimension, WIDTH)
    assert grid.redistribute(particles)
    check_sums(comm, grid, particles)
    drift = np.array([0.7, -0.4, 0.3])[:dimension]
    for step in range(12):
        wobble = 0.3 * np.sin(particles.name + step)[:, None]
        particles.position = particles.position + drift * 0.9 + wobble
        assert grid.update_cells(particles)
        check_sums(comm, grid, particles)
    assert comm.allreduce(grid.migrated) > 20 or comm.size == 1
    # the body has moved by ten cells: what it left behind is forgotten
    near = with_neighbours(grid.cells.index[grid.cells.occupied])
    assert particles.owned == 0 or len(grid.cells.index) <= 64 + 3 * len(near)
    assert grid.redistribute(particles)
    check_sums(comm, grid, particles)
    assert grid.imbalance(particles.owned) < 1.1


@pytest.mark.parametrize("dimension", [2, 3])
def test_sums_over_ranks_with_particles_that_stay_outside_their_cells(comm, dimension):
    particles = particle_set(comm, dimension)
    grid = RankGrid(comm, dimension, WIDTH)
    grid.slack = 3
    assert grid.redistribute(particles)
    for step in range(8):
        names = particles.name
        particles.position = particles.position + np.array([0.8, -0.7, 0.6])[:dimension]
        if step == 5:
            # the same partition, as after a restart: none has to leave
            assert grid.redistribute(particles, grid.partition)
        else:
            assert grid.update_cells(particles, release=step % 4 == 3)
        check_sums(comm, grid, particles)
        guests = comm.allreduce(len(grid.off_cell_particles()))
        if step % 4 == 3:
            assert guests == 0
        else:
            assert names is particles.name or (step == 5 and np.array_equal(names, particles.name))
            assert guests > 0 or comm.size == 1
    # farther than the sums reach
    assert grid.redistribute(particles)
    particles.position = particles.position + 40.0 * (comm.rank == 0)
    assert grid.update_cells(particles, release=False) == (comm.rank > 0 or comm.size == 1)


def test_nodes_behind_mirrors_come_with_their_images(comm):
    mirrors = (Mirror(0, 2 * -3, 1), Mirror(1, 2 * 6 + 1, -1))
    particles = particle_set(comm, 2)
    grid = RankGrid(comm, 2, WIDTH, mirrors)
    assert grid.redistribute(particles)
    for mirror in mirrors:
        behind, images, on_plane = grid.cells.mirrored(mirror)
        assert comm.allreduce(len(behind)) > 0
        ghosts, real = grid.cells.nodes[behind], grid.cells.nodes[images]
        np.testing.assert_array_equal(ghosts[:, mirror.axis] + real[:, mirror.axis], mirror.doubled)
        np.testing.assert_array_equal(ghosts[:, 1 - mirror.axis], real[:, 1 - mirror.axis])
        assert (mirror.side * (2 * ghosts[:, mirror.axis] - mirror.doubled) < 0).all()
        assert (2 * grid.cells.nodes[on_plane, mirror.axis] == mirror.doubled).all()
        occupied = np.unique(grid.cells.stencil)
        beyond = mirror.side * (2 * grid.cells.nodes[occupied, mirror.axis] - mirror.doubled) < 0
        assert np.isin(occupied[beyond], behind).all()
    check_sums(comm, grid, particles)


@pytest.mark.parametrize("dimension", [2, 3])
def test_ranks_share_nodes_behind_two_mirrors(comm, dimension):
    """A rank may have a node only as the image of an image, where two planes meet."""
    particles = particle_set(comm, dimension)
    particles.position = (particles.position + 3.0) / 3.0
    grid = RankGrid(comm, dimension, WIDTH, (Mirror(0, 2, 1), Mirror(1, 2, 1)))
    assert grid.redistribute(particles)
    check_sums(comm, grid, particles)


def test_the_order_within_cells_is_that_of_storage():
    cells = OccupiedCells(2, 2)
    bases = np.array([[0, 0], [1, 0], [0, 0], [0, 1], [0, 0]])
    assert len(cells.sort(bases, 5)) == 5
    cells.add(bases)
    assert len(cells.sort(bases, 5)) == 0
    np.testing.assert_array_equal(cells.order[:5], [0, 2, 4, 3, 1])
    np.testing.assert_array_equal(cells.start, [0, 3, 4, 5])


def test_a_particle_that_is_lost_is_told(comm):
    particles = particle_set(comm, 2, 40)
    grid = RankGrid(comm, 2, WIDTH)
    grid.redistribute(particles)
    if particles.owned and comm.rank == 0:
        particles.position[0] = np.nan, 1e9
    assert grid.update_cells(particles) == (comm.rank != 0)
    if comm.rank == 0:
        assert 0 not in grid.cells.order[: grid.cells.start[-1]]


@pytest.mark.serial
def test_grids_that_meet_look_as_far_as_the_wider_one():
    """Ranks whose parts come within the wider stencil, slack included, hear of each other."""
    asked = []
    partition = SimpleNamespace(box=lambda rank: [rank], near=lambda box, reach: asked.append(reach) or [1, 0])
    nodes = SharedNodes.__new__(SharedNodes)
    nodes.comm, nodes._partitions = SimpleNamespace(rank=0), [partition, partition]
    for grids in (((3, 0), (2, 2)), ((2, 2), (3, 0))):
        nodes.grids = tuple(SimpleNamespace(cells=SimpleNamespace(width=w), slack=s) for w, s in grids)
        assert nodes._near() == [1]
    assert set(asked) == {6}
