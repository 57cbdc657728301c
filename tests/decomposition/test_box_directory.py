"""Near ranks found without a table of all: a directory in parts, and plans for many ranks that there are not."""

import time
import tracemalloc

import numpy as np
import pytest
from point_sets import KINDS, point_set, share
from test_bisection import _Rank0

from decomposition import halo
from decomposition.bisection import bisect, cut_cells, cut_points
from decomposition.halo import Halo, directory_cells, introductions
from decomposition.migration import migrate


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_the_directory_finds_the_ranks_that_a_table_of_all_does(comm, monkeypatch, kind, dimension):
    points = point_set(kind, dimension)[share(comm, len(point_set(kind, dimension)))]
    points = migrate(comm, bisect(comm, points), {"points": points})["points"]
    found = []
    for few in (comm.size, 0):
        monkeypatch.setattr(halo, "_FEW", few)
        plan = Halo(comm, points, 0.25)
        found.append((plan.plan.neighbours, plan.with_ghosts(points).tolist()))
    assert found[0] == found[1]


@pytest.mark.serial
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_close_boxes_have_a_keeper_in_common(dimension):
    random, reach, ranks = np.random.default_rng(dimension), 0.05, 40
    lower = random.random((ranks, dimension))
    boxes = np.stack((lower, lower + 0.2 * random.random((ranks, dimension))), axis=1)
    everything = np.array((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))
    cells = [directory_cells(box, everything, reach, ranks) for box in boxes]
    entries = np.array([(cell, rank, *boxes[rank].ravel()) for rank in range(ranks) for cell in cells[rank]])
    told = {(int(rank), int(entries[int(row), 1])) for rank, row in introductions(entries, reach)}
    gap = np.maximum(np.maximum(boxes[:, None, 0] - boxes[None, :, 1], boxes[None, :, 0] - boxes[:, None, 1]), 0.0)
    expected = (gap**2).sum(axis=2) < reach**2
    np.fill_diagonal(expected, False)
    assert told == set(map(tuple, np.argwhere(expected)))


@pytest.mark.serial
def test_plans_of_4096_ranks_are_made_in_little_time_and_memory():
    ranks, reach = 4096, 0.02
    points = np.random.default_rng(0).random((32 * ranks, 3))
    owner, tree = cut_points(_Rank0(ranks), points)
    order = np.argsort(owner, kind="stable")
    pieces = np.split(points[order], np.searchsorted(owner[order], np.arange(1, ranks)))
    boxes = np.array([(piece.min(axis=0), piece.max(axis=0)) for piece in pieces])
    everything = np.array((points.min(axis=0), points.max(axis=0)))
    # what each rank tells the directory, and what a keeper has to do
    entries = [directory_cells(box, everything, reach, ranks) for box in boxes]
    assert max(map(len, entries)) <= 64
    held = np.bincount(np.concatenate(entries) % ranks, minlength=ranks)
    assert held.max() <= 256
    tracemalloc.start()
    began = time.process_time()
    for rank in range(0, ranks, 64):
        near = tree.neighbours(rank, reach)
        assert len(near) <= 128
        cells = directory_cells(boxes[rank], everything, reach, ranks)
        close = [rank, *near]
        rows = np.column_stack((np.full(len(close), cells[0]), close, boxes[close].reshape(len(close), -1)))
        told = introductions(rows, reach)
        assert len(told) <= len(close) ** 2
    seconds = (time.process_time() - began) / (ranks // 64)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert seconds < 0.02 and most < 2**20
    # the cuts, which every rank has: 32 bytes a dimension and rank
    assert tree.axes.nbytes + tree.cuts.nbytes <= 64 * ranks


@pytest.mark.serial
def test_cells_of_4096_ranks_know_their_neighbours_in_little_time():
    ranks = 4096
    cells = np.unique(np.random.default_rng(0).integers(0, 64, (100_000, 3)), axis=0)
    tree = cut_cells(_Rank0(ranks), cells, np.ones(len(cells), np.int64))
    tree.touching(cells[:10], 3, 0)
    began = time.process_time()
    for rank in range(0, ranks, 64):
        neighbours = tree.neighbours(rank, 3)
        mine = cells[tree.owners(cells) == rank] if rank % 512 == 0 else cells[:0]
        assert set(tree.touching(mine, 3, rank)[:, 1].tolist()) <= set(neighbours)
    assert (time.process_time() - began) / (ranks // 64) < 0.02
