"""A background grid over many ranks: ranks own cells and the particles in them, and share the nodes between their
cells.

Each rank sums what its own particles give to the nodes; `NodeSum` adds these partial sums of all ranks that have a
node, in the order of ranks, so that all of them go on with the same numbers. There are no ghost particles.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from .cell_partition import CellPartition, balanced
from .migration import migrate
from .node_sum import NodeSum, Sharing
from .occupied import FARTHEST, Mirror, OccupiedCells, indices_of, reflected
from .swap import swap
from .talking import TALKING

_PARTICLES_TAG, _OFFER_TAG, _SUM_TAG = 21, 22, 23
# cells without particles are forgotten when they are this many times as many as the others
_TOO_MANY_EMPTY, _ALWAYS_KEPT = 1.0, 64


class RankGrid:
    """The cells of one rank (`cells`, see `OccupiedCells`) and what it shares with others. Every call but `sum` is
    collective.

    The particles are an object with `owned`, their number, and the methods

        bases() -> (capacity, d)        cell index of each particle at its present place
        packed(rows) -> (n, c) float64  all there is to know of some particles
        remove(rows), insert(packed)    forget particles, take in others

    slack: so many cells from its own a rank keeps particles until a `settle` that releases them; 0: it keeps none. Set
    before particles are dealt out.
    """

    def __init__(self, comm: MPI.Comm, dimension: int, width: int, mirrors: tuple[Mirror, ...] = ()) -> None:
        """dimension 2 or 3; width: nodes of a stencil along one direction; mirrors: planes that the grid is
        folded at.
        """
        self.comm, self.dimension = comm, dimension
        self.cells = OccupiedCells(dimension, width, tuple(mirrors))
        self.sharing = Sharing([], [])
        self.migrated, self.slack = 0, 0
        self._adopt(CellPartition.whole(dimension))

    def _adopt(self, partition: CellPartition) -> None:
        self.partition = partition
        # a particle crosses less than one cell a step, a stencil reaches width - 1 cells; two ranks' guests may meet
        self.neighbours = partition.neighbours(self.comm.rank, self.cells.width + 2 * self.slack)
        self._offered_version = -1
        self._forget_pairs()
        self._offers = {rank: np.zeros(0, np.int64) for rank in self.neighbours}
        self._theirs = dict(self._offers)

    @property
    def version(self) -> tuple[int, int]:
        """Changes whenever cells, nodes or what is shared change: then stencils and sums must be fetched anew."""
        return self.cells.version, self.sharing.version

    def deal_out(
        self, particles: Any, partition: CellPartition | None = None, shares: np.ndarray | None = None
    ) -> bool:
        """Give every particle to the owner of its cell under a partition, or under a balanced one; then `settle`.

        A partition that is given is taken for that of the particles, whose guests stay. shares: see `balanced`.
        """
        kept = partition is not None and self.slack > 0
        bases = np.array(particles.bases()[: particles.owned], np.int64)
        inside = (np.abs(bases) < FARTHEST).all(axis=1)
        if partition is None:
            self.cells.compact()
            cells, counts = np.unique(bases[inside], axis=0, return_counts=True)
            # what a cell costs beside its particles: its nodes are added and read once
            partition = balanced(self.comm, cells, counts + 1, shares)
        if self.comm.size > 1:
            owner = partition.owners(bases)
            leaving = np.flatnonzero(owner != self.comm.rank)
            if kept:
                leaving = leaving[~self._near_own(partition, bases[leaving])]
            moved = migrate(self.comm, owner[leaving], {"rows": particles.packed(leaving)})["rows"]
            particles.remove(leaving)
            particles.insert(moved)
            self.migrated += len(leaving)
        self.cells.compact()
        self._adopt(partition)
        return self.settle(particles, not kept)

    def imbalance(self, owned: int) -> float:
        """Largest over mean number of particles on a rank."""
        with TALKING:
            counts = np.array(self.comm.allgather(owned))
        return float(counts.max() / max(counts.mean(), 1e-300))

    def settle(self, particles: Any, release: bool = True) -> bool:
        """List particles by cell, hand those that left to their new owners, and agree on the shared nodes.

        release: on all ranks alike, False for a rank with `slack` to keep those that left. Talks to neighbours only.
        False when a particle of this rank is beyond the lattice, is not a number, or went farther than to a neighbour,
        or than the slack; such a particle stays.
        """
        bases = particles.bases()
        strays, sound = self._sort(particles, bases), True
        if len(strays):
            lost = self.cells.lost(strays)
            sound, strays = not lost.any(), strays[~lost]
        if self.neighbours and (release or not self.slack):
            bases, kept = self._migrate(particles, bases, np.concatenate((strays, self.guests())))
            sound = sound and kept
        elif len(strays):
            at = bases[strays].astype(np.int64)
            self.cells.add(at)
            self._sort(particles, bases)
            sound = sound and bool(self._near_own(self.partition, at).all())
        if len(self.cells.index) > _ALWAYS_KEPT + (1.0 + _TOO_MANY_EMPTY) * self.cells.occupied.sum():
            self.cells.compact()
            self._forget_pairs()
            self._sort(particles, bases)
        if self.neighbours:
            self._agree()
        return sound

    def guests(self) -> np.ndarray:
        """Rows of the particles that are listed in cells of other ranks, without `slack` none."""
        cells = self.cells
        if not self.slack:
            return np.zeros(0, np.int64)
        foreign = np.flatnonzero((self.partition.owners(cells.index) != self.comm.rank) & cells.occupied)
        return np.concatenate(
            [np.zeros(0, np.int64), *(cells.order[cells.start[c] : cells.start[c + 1]] for c in foreign)]
        )

    def _near_own(self, partition: CellPartition, cells: np.ndarray) -> np.ndarray:
        """Which cells (n, d) are at most `slack` from one that may be this rank's own (n,) bool."""
        result = np.full(len(cells), partition.ranks == 1)
        found = partition.touching(cells + self.slack, 2 * self.slack + 1, -1)
        result[found[found[:, 1] == self.comm.rank, 0]] = True
        return result

    def _sort(self, particles: Any, bases: np.ndarray) -> np.ndarray:
        return self.cells.sort(bases, particles.owned)

    def _migrate(self, particles: Any, bases: np.ndarray, strays: np.ndarray) -> tuple[np.ndarray, bool]:
        """Send particles in cells of others to their owners and list new cells of this rank's own.

        Returns the cells of all particles, and whether none was left between ranks that are no neighbours.
        """
        at, leaving, sound = bases[strays].astype(np.int64), [strays] * len(self.neighbours), True
        if len(strays):
            owner = self.partition.owners(at)
            sound = bool(np.isin(owner, [self.comm.rank, *self.neighbours]).all())
            leaving = [strays[owner == rank] for rank in self.neighbours]
            at = at[~np.isin(owner, self.neighbours)]
        arrived = np.concatenate(
            swap(self.comm, self.neighbours, [particles.packed(rows) for rows in leaving], _PARTICLES_TAG)
        )
        gone = np.concatenate(leaving)
        self.cells.add(at)
        if len(gone):
            particles.remove(gone)
            self.migrated += len(gone)
        if len(arrived):
            particles.insert(arrived)
        if len(gone) or len(arrived):
            bases = particles.bases()
        if len(strays) or len(arrived):
            strays = self._sort(particles, bases)
            if len(strays):
                self.cells.add(bases[strays[~self.cells.lost(strays)]].astype(np.int64))
                self._sort(particles, bases)
        return bases, sound

    def _agree(self) -> None:
        """Tell neighbours which nodes here may concern them, if they have changed, and find the shared ones."""
        changed = self._offered_version != self.cells.version
        if changed:
            self._find_offers()
            self._offered_version = self.cells.version
        nothing = np.zeros(0, np.int64)
        messages = [np.concatenate(([-1], self._offers[rank])) if changed else nothing for rank in self.neighbours]
        for rank, message in zip(self.neighbours, swap(self.comm, self.neighbours, messages, _OFFER_TAG)):
            if len(message):
                self._theirs[rank] = message[1:].copy()
                changed = True
        if changed:
            self._share()

    def _forget_pairs(self) -> None:
        """Pairs (word of a node, rank that it may concern) of the nodes known by their words."""
        self._known, self._pairs = np.zeros(0, np.int64), np.zeros((0, 2), np.int64)

    def _find_offers(self) -> None:
        word = np.setdiff1d(self.cells.node_words, self._known, assume_unique=True)
        new = indices_of(word, self.dimension)
        width, here, slack = self.cells.width, self.comm.rank, self.slack
        pairs = [self.partition.touching(new + slack, width + 2 * slack, here)]
        for mirror in self.cells.mirrors:
            rows, images = reflected(new, mirror, width)
            found = self.partition.touching(images + slack, width + 2 * slack, here)
            pairs.append(np.stack((rows[found[:, 0]], found[:, 1]), axis=1))
        found = np.concatenate(pairs)
        found[:, 0] = word[found[:, 0]]
        self._pairs, self._known = np.concatenate((self._pairs, found)), self.cells.node_words
        for rank in self.neighbours:
            self._offers[rank] = np.unique(self._pairs[self._pairs[:, 1] == rank, 0])

    def _share(self) -> None:
        common = [np.intersect1d(self._offers[rank], self._theirs[rank]) for rank in self.neighbours]
        shared = [self.cells.slots(word) for word in common]
        self.sharing = Sharing(self.neighbours, shared, self.sharing.version + 1)

    def sum(self, nodes: np.ndarray, first: int, last: int, tag: int) -> NodeSum:
        """Adds up columns first..last-1 of nodes (slots, c) over the ranks; for the present `version` only.

        tag: a small number that tells sums under way at one time apart.
        """
        return NodeSum(self.comm, self.sharing, nodes, (first, last), _SUM_TAG + tag)
