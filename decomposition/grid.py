"""A background grid over many ranks: ranks own cells and the particles in them, and share the nodes between their
cells.

Each rank sums what its own particles give to the nodes; the sums of a `Plan` add these partial sums of all ranks that
have a node, in the order of ranks, so that all of them go on with the same numbers. There are no ghost particles.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from .bisection import CutTree, cut_cells
from .migration import migrate
from .occupied import FARTHEST, Mirror, OccupiedCells, reflected, with_neighbours
from .plan import Plan, swap
from .timer import COMMUNICATION

# cells far from particles are forgotten when there are more cells than so many, and so many times those near particles
_ALWAYS_KEPT, _MOST_TIMES = 64, 2


class NeighbourArrays:
    """Arrays of whole numbers that a rank and its neighbours tell each other, only when they have changed.

    mine, theirs: an array a neighbour.
    """

    def __init__(self, comm: MPI.Comm, neighbours: Sequence[int]) -> None:
        self.comm, self.neighbours = comm, list(neighbours)
        self.mine = [np.zeros(0, np.int64) for _ in self.neighbours]
        self.theirs = list(self.mine)

    def update(self, mine: list[np.ndarray] | None) -> bool:
        """Tell the neighbours new arrays, or, with None, that they are as before; whether any are new here."""
        nothing, changed = np.zeros(0, np.int64), mine is not None
        if mine is not None:
            self.mine = mine
        messages = [np.append(-1, array) if changed else nothing for array in self.mine]
        for number, message in enumerate(swap(self.comm, self.neighbours, messages)):
            if len(message):
                self.theirs[number], changed = message[1:].copy(), True
        return changed


class RankGrid:
    """The cells of one rank (`cells`, see `OccupiedCells`), what it shares with others (`shared`, a plan of slots of
    nodes, by which they are summed) and the owners of all cells (`partition`). Every call is collective.

    The particles are an object with `owned`, their number, and the methods

        bases() -> (capacity, d)        cell index of each particle at its present place
        packed(rows) -> (n, c) float64  all there is to know of some particles
        remove(rows), insert(packed)    forget particles, take in others

    slack: so many cells from its own a rank keeps particles until an `update_cells` that releases them; 0: it keeps
    none. Set before particles are distributed.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        dimension: int,
        width: int,
        mirrors: tuple[Mirror, ...] = (),
        further: tuple[tuple[int, int], ...] = (),
    ) -> None:
        """dimension 2 or 3; width: nodes of a stencil along one direction; mirrors: planes that the grid is
        folded at; further: see `OccupiedCells`.
        """
        self.comm, self.dimension = comm, dimension
        self.cells = OccupiedCells(dimension, width, mirrors, further)
        self.shared, self._agreed = Plan(comm, [], [], []), 0
        self.migrated, self.slack = 0, 0
        self._adopt(CutTree.whole(dimension))

    @property
    def _reach(self) -> int:
        """How far nodes of a rank may be beyond the stencils of its own cells [cells]."""
        return self.slack + (1 if self.cells.further else 0)

    def _adopt(self, partition: CutTree) -> None:
        self.partition = partition
        # a particle crosses less than one cell a step, a stencil reaches width - 1 cells; off-cell particles of two
        # ranks may meet
        self.neighbours = partition.neighbours(self.comm.rank, self.cells.width + 2 * self._reach)
        self._candidates, self._told_version = NeighbourArrays(self.comm, self.neighbours), -1

    @property
    def version(self) -> tuple[int, int]:
        """Changes whenever cells, nodes or what is shared change: then stencils and sums must be fetched anew."""
        return self.cells.version, self._agreed

    def redistribute(self, particles: Any, partition: CutTree | None = None) -> bool:
        """Give every particle to the owner of its cell under a partition, or under a balanced one; then `update_cells`.

        A partition that is given is taken for that of the particles: those off its cells stay.
        """
        kept = partition is not None and self.slack > 0
        bases = np.array(particles.bases()[: particles.owned], np.int64)
        inside = (np.abs(bases) < FARTHEST).all(axis=1)
        if partition is None:
            cells, counts = np.unique(bases[inside], axis=0, return_counts=True)
            # what a cell costs beside its particles: its nodes are added and read once
            partition = cut_cells(self.comm, cells, counts + 1)
        if self.comm.size > 1:
            owner = partition.owners(bases)
            leaving = np.flatnonzero(owner != self.comm.rank)
            if kept:
                leaving = leaving[~self._near_own(partition, bases[leaving])]
            moved = migrate(self.comm, owner[leaving], {"rows": particles.packed(leaving)})["rows"]
            particles.remove(leaving)
            particles.insert(moved)
            self.migrated += len(leaving)
        self.cells.clear()
        self._adopt(partition)
        return self.update_cells(particles, not kept)

    def imbalance(self, owned: int) -> float:
        """Largest over mean number of particles on a rank."""
        with COMMUNICATION:
            largest = self.comm.allreduce(owned, MPI.MAX)
            total = self.comm.allreduce(owned)
        return float(largest * self.comm.size / max(total, 1e-300))

    def update_cells(self, particles: Any, release: bool = True) -> bool:
        """List particles by cell, hand those that left to their new owners, and agree on the shared nodes.

        release: on all ranks alike, False for a rank with `slack` to keep those that left. Talks to neighbours only.
        False when a particle of this rank is beyond the lattice, is not a number, or went farther than to a neighbour,
        or than the slack; such a particle stays.
        """
        bases = particles.bases()
        unlisted, sound = self._sort(particles, bases), True
        if len(unlisted):
            lost = self.cells.lost(unlisted)
            sound, unlisted = not lost.any(), unlisted[~lost]
        if self.neighbours and (release or not self.slack):
            bases, kept = self._migrate(particles, bases, np.concatenate((unlisted, self.off_cell_particles())))
            sound = sound and kept
        elif len(unlisted):
            at = bases[unlisted].astype(np.int64)
            self._list(at)
            self._sort(particles, bases)
            sound = sound and bool(self._near_own(self.partition, at).all())
        if self.neighbours:
            # find the nodes that this rank shares with its neighbours, if those of any have changed
            changed = self._told_version != self.cells.version
            self._told_version = self.cells.version
            told = self._candidates
            if told.update(self._shared_candidates() if changed else None):
                common = [np.intersect1d(mine, theirs) for mine, theirs in zip(told.mine, told.theirs)]
                slots = [self.cells.slots(word) for word in common]
                self.shared, self._agreed = Plan(self.comm, self.neighbours, slots, slots), self._agreed + 1
        return sound

    def off_cell_particles(self) -> np.ndarray:
        """Rows of the particles that are listed in cells of other ranks, without `slack` none."""
        cells = self.cells
        if not self.slack:
            return np.zeros(0, np.int64)
        foreign = np.flatnonzero((self.partition.owners(cells.index) != self.comm.rank) & cells.occupied)
        return np.concatenate(
            [np.zeros(0, np.int64), *(cells.order[cells.start[c] : cells.start[c + 1]] for c in foreign)]
        )

    def _near_own(self, partition: CutTree, cells: np.ndarray) -> np.ndarray:
        """Which cells (n, d) are at most `slack` from one that may be this rank's own (n,) bool."""
        result = np.full(len(cells), partition.ranks == 1)
        found = partition.touching(cells + self.slack, 2 * self.slack + 1, -1)
        result[found[found[:, 1] == self.comm.rank, 0]] = True
        return result

    def _list(self, cells: np.ndarray) -> None:
        """List further cells (n, d), and this rank's own cells around all that have particles: these go there next,
        and the list changes seldom. `sort` must follow."""
        if len(cells) == 0:
            return
        held = np.concatenate((cells, self.cells.index[self.cells.occupied]))
        around = with_neighbours(held)
        if self.comm.size > 1:
            around = np.concatenate((held, around[self.partition.owners(around) == self.comm.rank]))
        if len(self.cells.index) > _ALWAYS_KEPT + _MOST_TIMES * len(around):
            self.cells.keep(around)
        else:
            self.cells.add(around)

    def _sort(self, particles: Any, bases: np.ndarray) -> np.ndarray:
        return self.cells.sort(bases, particles.owned)

    def _migrate(self, particles: Any, bases: np.ndarray, unlisted: np.ndarray) -> tuple[np.ndarray, bool]:
        """Send particles in cells of others to their owners and list new cells of this rank's own.

        Returns the cells of all particles, and whether none was left between ranks that are no neighbours.
        """
        at, leaving, sound = bases[unlisted].astype(np.int64), [unlisted] * len(self.neighbours), True
        if len(unlisted):
            owner = self.partition.owners(at)
            sound = bool(np.isin(owner, [self.comm.rank, *self.neighbours]).all())
            leaving = [unlisted[owner == rank] for rank in self.neighbours]
            at = at[~np.isin(owner, self.neighbours)]
        arrived = np.concatenate(swap(self.comm, self.neighbours, [particles.packed(rows) for rows in leaving]))
        gone = np.concatenate(leaving)
        self._list(at)
        if len(gone):
            particles.remove(gone)
            self.migrated += len(gone)
        if len(arrived):
            particles.insert(arrived)
        if len(gone) or len(arrived):
            bases = particles.bases()
        if len(unlisted) or len(arrived):
            unlisted = self._sort(particles, bases)
            if len(unlisted):
                self._list(bases[unlisted[~self.cells.lost(unlisted)]].astype(np.int64))
                self._sort(particles, bases)
        return bases, sound

    def _shared_candidates(self) -> list[np.ndarray]:
        """Words of this rank's nodes that each neighbour may have, too, rising."""
        cells, here, reach, width = self.cells, self.comm.rank, self._reach, self.cells.width
        # a rank has its cells' nodes and their images, where planes meet also images of images
        rows, places = np.arange(len(cells.nodes)), cells.nodes
        for mirror in reversed(cells.mirrors):
            near, images = reflected(places, mirror, width)
            rows, places = np.concatenate((rows, rows[near])), np.concatenate((places, images))
        found = self.partition.touching(places + reach, width + 2 * reach, here)
        pairs = np.stack((rows[found[:, 0]], found[:, 1]), axis=1)
        return [cells.node_words[rows] for rows in rows_of_ranks(pairs, self.neighbours)]

    def shared_slots(self) -> np.ndarray:
        """Slots of the nodes that other ranks have, too, rising."""
        return np.unique(np.concatenate([np.zeros(0, np.int64), *self.shared.send_rows]))


def rows_of_ranks(pairs: np.ndarray, ranks: Sequence[int]) -> list[np.ndarray]:
    """Rows, rising, that stand in pairs (row, rank) with each of some ranks."""
    return [np.unique(pairs[pairs[:, 1] == rank, 0]) for rank in ranks]
