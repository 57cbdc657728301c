"""Arrays of a rank's nodes and cells, as the grid kernels take them, kept up with the cells that particles occupy."""

import numpy as np

from parsolid.methods.mpm import grid as kernels
from parsolid.numerics.lanes import aligned_zeros


class NodeTables:
    """nodes (slots, 8) and, with `twice`, again (slots, 8) for momentum that is mapped back; see `methods.mpm.grid` for the columns.

    With `warm`, heat (slots, 8), see `methods.mpm.heat`, and its sums over ranks of capacities and of flows.

    grid: `kernels.Grid`; places (nodes, 4) [m]; share (nodes,): what counts of a node on this rank's side of mirror planes, if no
    lower rank counts it; partial (cells, width**d, 8): parts of single cells, with bitwise sums, else None.
    """

    def __init__(self, ranks, origin: np.ndarray, spacing: float, planes: list, twice: bool, warm: bool = False):
        """ranks: `decomposition.RankGrid`; planes: `grid_conditions.FoldedPlane`s."""
        self.ranks, self.origin, self.spacing, self.planes, self.twice = ranks, origin, spacing, planes, twice
        self.warm = warm
        self.nodes, self.again, self.heat, self.partial = aligned_zeros((0, 8)), None, None, None
        self._seen = None
        self.changes = 0

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.ranks.cells.index)

    @property
    def count(self) -> int:
        """Number of nodes."""
        return len(self.ranks.cells.nodes)

    def update(self) -> None:
        """Follow the cells; cheap when nothing has changed but the particles' order."""
        cells = self.ranks.cells
        if self._seen != self.ranks.version:
            self._rebuild()
            self._seen = self.ranks.version
        self.grid = kernels.Grid(
            self.origin, self.spacing, 1.0 / self.spacing, self._base, cells.start, cells.order, cells.stencil
        )

    def _rebuild(self) -> None:
        cells, d = self.ranks.cells, self.ranks.dimension
        if len(self.nodes) < self.count:
            room = self.count + self.count // 4
            self.nodes = aligned_zeros((room, 8))
            self.again = aligned_zeros((room, 8)) if self.twice else None
            self.heat = aligned_zeros((room, 8)) if self.warm else None
        self._base = aligned_zeros((self.cells, 4))
        self._base[:, :d] = cells.index
        self.places = np.zeros((self.count, 4))
        self.places[:, :d] = self.origin[:d] + self.spacing * cells.nodes
        self._folds, self.share = [], np.ones(self.count)
        for plane in self.planes:
            behind, images, on_plane = cells.mirrored(plane.mirror)
            ghosts = np.concatenate((behind, on_plane)).astype(np.int32)
            self._folds.append((ghosts, np.concatenate((images, on_plane)).astype(np.int32), plane.signs))
            self.share[behind] = 0.0
            self.share[on_plane] *= 0.5
        for rank, shared in zip(self.ranks.sharing.neighbours, self.ranks.sharing.shared):
            if rank < self.ranks.comm.rank:
                self.share[shared] = 0.0
        flat = None
        if self.ranks.bitwise:
            self.partial = aligned_zeros((self.cells, cells.stencil.shape[1], 8))
            flat = self.partial.reshape(-1, 8)
        self.sum = self.ranks.sum(self.nodes, 0, 7, 0, flat)
        self.sum_again = self.ranks.sum(self.again, 0, 4, 1, flat) if self.twice else None
        self.sum_heat = self.ranks.sum(self.heat, 0, 2, 2, flat) if self.warm else None
        self.sum_flow = self.ranks.sum(self.heat, 4, 5, 3, flat) if self.warm else None
        self.changes += 1

    @property
    def bytes_sent(self) -> int:
        """Bytes this rank sends in the sums of a step."""
        return sum(
            each.bytes_sent for each in (self.sum, self.sum_again, self.sum_heat, self.sum_flow) if each is not None
        )

    def clear(self) -> None:
        """Zeros to begin a step with."""
        self._clear(self.nodes)

    def clear_again(self) -> None:
        """Zeros for momentum that is mapped back."""
        self._clear(self.again)

    def clear_heat(self) -> None:
        """Zeros to begin a step of the conduction with."""
        self._clear(self.heat)

    def _clear(self, nodes: np.ndarray) -> None:
        nodes[: self.count] = 0.0
        if self.partial is not None:
            # cells without particles are not visited
            self.partial[~self.ranks.cells.occupied] = 0.0

    def fold(self, nodes: np.ndarray) -> None:
        """Add what the body's images give; before velocities are found."""
        for ghosts, images, signs in self._folds:
            kernels.fold_mirror(ghosts, images, signs, nodes)

    def spread(self, nodes: np.ndarray) -> None:
        """Give nodes behind mirror planes the reflected velocities."""
        for ghosts, images, signs in reversed(self._folds):
            kernels.spread_mirror(ghosts, images, signs, nodes)

    def arrays(self) -> list[np.ndarray]:
        """Arrays that count as memory."""
        named = (self.nodes, self.again, self.heat, self.partial)
        return [array for array in named if array is not None]
