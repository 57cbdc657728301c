"""Migration: particles belong to the rank that owns their cell, and are stored in the order of the cells."""

import math

import numpy as np

from decomposition.bisection import CutTree
from decomposition.grid import RankGrid
from parsolid.collective import maximum
from parsolid.methods.mpm.points import MaterialPoints

# steps between checks of the order of storage and the balance of ranks; share of particles out of order above which
# storage is sorted
_PERIOD, _DISORDER = 16, 0.3


class CellMigration:
    """Keeps this rank's particles in the cells of its `decomposition.grid.RankGrid`.

    steps: number of steps, which times the checks; rebalanced: how often cells were distributed anew; layout_version:
    how often rows may have changed on any rank, where particles keep their rows between checks (`keeps_rows`).
    """

    def __init__(self, grid: RankGrid, points: MaterialPoints):
        self.grid, self.points, self.settings = grid, points, points.settings
        self.steps, self.rebalanced = 0, 0
        self.layout_version, self.keeps_rows = 0, False

    def keep_rows(self) -> None:
        """Let ranks keep particles that have left their cells until the next check; called before `redistribute`.

        A particle crosses less than cfl cells in a step.
        """
        self.keeps_rows = self.grid.comm.size > 1
        self.grid.slack = math.ceil(_PERIOD * min(self.settings.cfl, 1.0)) + 1 if self.keeps_rows else 0

    def redistribute(self, partition: CutTree | None = None) -> bool:
        """Give particles to the owners of their cells under a partition, or under a balanced one; collective.

        False where a particle is lost, see `RankGrid.settle`.
        """
        sound = self.grid.redistribute(self.points, partition)
        if partition is None:
            self._sort_storage()
        return sound

    def migrate(self) -> bool:
        """List particles by cell anew and send those that left to their owners; every 16 steps check order and balance.

        False where a particle is lost.
        """
        sound = self.grid.update_cells(self.points, release=not self.keeps_rows)
        self.steps += 1
        return self._tidy() and sound if self.steps % _PERIOD == 0 else sound

    def _tidy(self) -> bool:
        """Balance the ranks, or else sort storage, where needed."""
        if self.keeps_rows:
            return self._tidy_together()
        owned = self.points.owned
        if self.grid.comm.size > 1 and self.grid.imbalance(owned) > self.settings.rebalance:
            self.rebalanced += 1
            return self.redistribute()
        if self.grid.cells.breaks(owned) > _DISORDER * owned:
            self._sort_storage()
        return True

    def _tidy_together(self) -> bool:
        """As `_tidy` where particles keep their rows: also sends away particles that left their cells. Collective."""
        owned, cells = self.points.owned, self.grid.cells
        disorder, off_cell = cells.breaks(owned) > _DISORDER * owned, len(self.grid.off_cell_particles())
        any_off_cell, any_disorder = maximum(self.grid.comm, np.array([off_cell, disorder], float)) > 0.0
        uneven = self.grid.imbalance(owned) > self.settings.rebalance
        if not (any_off_cell or any_disorder or uneven):
            return True
        self.layout_version += 1
        if uneven:
            self.rebalanced += 1
            return self.redistribute()
        sound = self.grid.update_cells(self.points) if any_off_cell else True
        if disorder:
            self._sort_storage()
        return sound

    def _sort_storage(self) -> None:
        """Bring particles into the order of the cells, unless one is in no cell, which ends the run."""
        cells, points = self.grid.cells, self.points
        if cells.start[-1] == points.owned:
            points.reorder(cells.order[: points.owned].copy())
            cells.sort(points.bases(), points.owned)
