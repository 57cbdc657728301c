"""The nodes of a rank's background grid: their arrays, what ranks add up, and their new velocities.

Only nodes near particles exist; they are numbered by slots. `transfer` has the columns of the arrays.
"""

import numpy as np

from decomposition.grid import RankGrid
from decomposition.occupied import Mirror
from decomposition.plan import Exchange
from parsolid.boundary.mirror_planes import MirrorPlane
from parsolid.collective import minimum
from parsolid.kernels import kernel
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.methods.mpm.transfer import Cells

# nodes lighter than this share of the lightest particle do not move
_LEAST_MASS = 1e-9


@kernel
def accelerate(count, nodes, step, least_mass):
    """Velocities v after a step [s], and their changes in it, from momentum and force; nodes lighter than least_mass
    [kg] stand still."""
    for i in range(count):
        mass = nodes[i, 3]
        if mass > least_mass:
            for d in range(3):
                change = step / mass * nodes[i, 4 + d]
                nodes[i, d] = nodes[i, d] * (1.0 / mass) + change
                nodes[i, 4 + d] = change
        else:
            nodes[i] = 0.0


@kernel
def velocities_of_momentum(count, nodes, least_mass):
    """Velocities from momentum alone; columns 4..7 become 0."""
    for i in range(count):
        scale = 1.0 / nodes[i, 3] if nodes[i, 3] > least_mass else 0.0
        for d in range(3):
            nodes[i, d] *= scale
            nodes[i, 4 + d] = 0.0


@kernel
def fold(behind, image, signs, nodes):
    """Add what the mirror image of the body gives to the nodes before a mirror plane; before `accelerate`.

    behind, image (n,): slots of the nodes on and behind the plane, and of their mirror images (a node on the plane is
    its own); signs (8,): of each column of nodes, -1 for the momentum and force that the mirror reverses. Exact for
    every basis if the plane lies on nodes or halfway between. Where planes meet, they are folded one after the other.
    """
    for k in range(behind.size):
        for c in range(8):
            nodes[image[k], c] += signs[c] * nodes[behind[k], c]


@kernel
def unfold(behind, image, signs, nodes):
    """Give the nodes behind a mirror plane the reflected velocities of their images; planes in reverse order."""
    for k in range(behind.size):
        for c in range(8):
            nodes[behind[k], c] = signs[c] * nodes[image[k], c]


class FoldedPlane:
    """A mirror plane on nodes or halfway between; signs (8,): how its image changes the columns of nodes."""

    def __init__(self, plane: MirrorPlane, mirror: Mirror):
        self.plane, self.mirror, self.signs = plane, mirror, np.ones(8)
        self.signs[0:3] = self.signs[4:7] = plane.signs()


class Nodes:
    """The nodes' arrays, kept up with the cells that particles occupy.

    motion (slots, 8); remapped (slots, 8): velocities of the momentum that is mapped back (MUSL); heat (slots, 8), see
    `heat`; cells: `Cells` of the step; places (count, 4) [m]; share (count,): what counts of a node on this rank: of a
    node behind a mirror plane nothing, of one on it half, and of one that several ranks have the part of its mass that
    this rank's particles give; mirrored: axis, slots behind each mirror plane, of their images, and on it;
    changes: counts when slots change.
    """

    def __init__(self, grid: RankGrid, points: MaterialPoints, planes: list[FoldedPlane], conducts: bool):
        """conducts: whether there is heat on nodes. Collective."""
        lightest = minimum(grid.comm, float(points.owned_rows("mass").min(initial=np.inf)))
        self.least_mass = _LEAST_MASS * lightest
        self.grid, self.points, self.planes = grid, points, planes
        self.spacing = float(points.settings.cell)
        self._remaps, self._conducts = points.settings.order == "musl", conducts
        self.motion = self.remapped = self.heat = np.zeros((0, 8))
        self.changes = 0
        self._seen: tuple[int, int] | None = None

    @property
    def count(self) -> int:
        return len(self.grid.cells.nodes)

    def follow_cells(self) -> None:
        """Take over the cells and their particles."""
        cells, points = self.grid.cells, self.points
        if self._seen != self.grid.version:
            self._rebuild()
            self._seen = self.grid.version
        self.cells = Cells(
            *(tuple(range(points.dimension)), points.axisymmetric, points.origin, self.spacing),
            *(self._base, cells.start, cells.order, cells.stencil),
        )

    def _rebuild(self) -> None:
        cells, d = self.grid.cells, self.grid.dimension
        if len(self.motion) < self.count:
            room = self.count + self.count // 4
            self.motion = np.zeros((room, 8))
            self.remapped = np.zeros((room if self._remaps else 0, 8))
            self.heat = np.zeros((room if self._conducts else 0, 8))
        self._base, self.places = np.zeros((len(cells.index), 4)), np.zeros((self.count, 4))
        self._base[:, :d] = cells.index
        self.places[:, :d] = self.points.origin[:d] + self.spacing * cells.nodes
        # nodes behind and on the mirror planes, and what counts of each node
        self.share = np.ones(self.count)
        self._folds: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.mirrored: list[tuple[int, np.ndarray, np.ndarray, np.ndarray]] = []
        for plane in self.planes:
            behind, images, on_plane = self.grid.cells.mirrored(plane.mirror)
            self.mirrored.append((plane.mirror.axis, behind, images, on_plane))
            self._folds.append((np.concatenate((behind, on_plane)), np.concatenate((images, on_plane)), plane.signs))
            self.share[behind] = 0.0
            self.share[on_plane] *= 0.5
        self._common = self.grid.shared_slots()
        self._share_of_all = self.share[self._common]
        self._sums: dict[str, Exchange] = {"motion": self.grid.shared.sum(self.motion[:, 0:7])}
        if self._remaps:
            self._sums["remapped"] = self.grid.shared.sum(self.remapped[:, 0:4])
        if self._conducts:
            self._sums["capacity"] = self.grid.shared.sum(self.heat[:, 0:2])
            self._sums["flow"] = self.grid.shared.sum(self.heat[:, 4:5])
        self.changes += 1

    # --- in a step --------------------------------------------------------------------------------------------------

    def clear(self, nodes: np.ndarray) -> None:
        """Zeros, before particles give anything to nodes."""
        nodes[: self.count] = 0.0

    def exchange(self, name: str) -> None:
        """Add up what the particles of all ranks have given: "motion", "remapped", "capacity" or "flow"."""
        own = self.motion[self._common, 3]
        self._sums[name].now()
        if name == "motion" and len(self._common):
            mass = self.motion[self._common, 3]
            self.share[self._common] = self._share_of_all * own / np.where(mass > 0.0, mass, 1.0)

    def accelerate(self, step: float) -> None:
        """Velocities after the forces of a step [s], and their changes, before boundaries."""
        self._fold(self.motion)
        accelerate(self.count, self.motion, step, self.least_mass)

    def find_remapped_velocities(self) -> None:
        """Velocities of the momentum that was mapped back, before boundaries."""
        self._fold(self.remapped)
        velocities_of_momentum(self.count, self.remapped, self.least_mass)

    def _fold(self, nodes: np.ndarray) -> None:
        for behind, images, signs in self._folds:
            fold(behind, images, signs, nodes)

    def unfold(self, nodes: np.ndarray) -> None:
        """Give nodes behind mirror planes the reflected velocities."""
        for behind, images, signs in reversed(self._folds):
            unfold(behind, images, signs, nodes)

    @property
    def bytes_sent(self) -> int:
        return sum(each.bytes_sent for each in self._sums.values())
