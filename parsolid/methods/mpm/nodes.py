"""Arrays of a rank's nodes and cells, as the grid kernels take them, kept up with the cells that particles occupy."""

import numpy as np

from decomposition.grid import RankGrid
from decomposition.node_sum import CellSum, NodeSum
from decomposition.talking import TALKING
from parsolid.boundary.reactions import Told
from parsolid.boundary.surface_loads import SurfaceLoads
from parsolid.collective import minimum
from parsolid.methods.mpm import grid as kernels
from parsolid.methods.mpm.grid_conditions import FoldedPlane
from parsolid.methods.mpm.mass_matrix import MassMatrix
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.numerics.lanes import aligned_zeros
from parsolid.numerics.layout import Axisymmetric
from parsolid.numerics.sums import in_turn

# nodes lighter than this share of the lightest particle do not move
_LEAST_MASS = 1e-9


class Nodes:
    """motion (slots, 8), see `methods.mpm.grid` for the columns; again (slots, 8): the same of momentum that is mapped
    back.

    heat (slots, 8), see `methods.mpm.heat`; again and heat only where the scene has them.
    interpolation: `kernels.Interpolation` of the step, to be found anew when particles have been listed anew.
    places (count, 4) [m]; share (count,): what counts of a node on this rank: what is on its side of mirror planes, as
    far as the step's mass is that of its particles; surface_loads: what acts on surfaces, set with the boundaries;
    mirrored: axis, slots behind each mirror plane, of their images, and on it;
    told: conditions that tell what they take, see `boundary.reactions`;
    partial (cells, width**d, 8): parts of single cells, with bitwise sums, else None.
    """

    def __init__(self, ranks: RankGrid, points: MaterialPoints, planes: list[FoldedPlane], conducts: bool):
        """ranks: `decomposition.RankGrid`; points: `MaterialPoints`, none on a mirror plane; planes: `FoldedPlane`s.
        Collective.
        """
        lightest = minimum(ranks.comm, float(points.owned_rows("mass").min(initial=np.inf)))
        self.least_mass, self._no_gravity = _LEAST_MASS * lightest, aligned_zeros((1, 4))
        self.ranks, self.points, self.planes = ranks, points, planes
        self.space = Axisymmetric() if points.axisymmetric else points.space
        self.spacing = float(points.settings.cell)
        self.mass = MassMatrix(points) if points.settings.mass_terms > 1 else None
        self.twice, self.warm = points.settings.order == "musl" or self.mass is not None, conducts
        self.scratch = kernels.make_scratch(points.basis, ranks.dimension)
        self.motion = self.again = self.heat = aligned_zeros((0, 8))
        self.partial: np.ndarray | None = None
        self.told: list[Told] = []
        self.surface_loads: SurfaceLoads | None = None
        self.changes = 0
        self._seen: tuple[int, int] | None = None
        self._sums: dict[str, NodeSum | CellSum] = {}
        self._impulse = np.zeros((0, 3))

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.ranks.cells.index)

    @property
    def count(self) -> int:
        """Number of nodes."""
        return len(self.ranks.cells.nodes)

    def follow_cells(self) -> None:
        """Take over the cells and their particles; cheap when nothing has changed but the particles' order."""
        cells, points = self.ranks.cells, self.points
        if self._seen != self.ranks.version:
            self._rebuild()
            self._seen = self.ranks.version
        spacing = self.spacing, 1.0 / self.spacing
        grid = kernels.Grid(points.origin, *spacing, self._base, cells.start, cells.order, cells.stencil)
        self.interpolation = kernels.Interpolation(self.space, points.basis, grid, self.scratch, points.places)

    def _rebuild(self) -> None:
        cells, d = self.ranks.cells, self.ranks.dimension
        if len(self.motion) < self.count:
            room = self.count + self.count // 4
            self.motion = aligned_zeros((room, 8))
            self.again = aligned_zeros((room if self.twice else 0, 8))
            self.heat = aligned_zeros((room if self.warm else 0, 8))
        self._base = aligned_zeros((self.cells, 4))
        self._base[:, :d] = cells.index
        self.places = np.zeros((self.count, 4))
        self.places[:, :d] = self.points.origin[:d] + self.spacing * cells.nodes
        self._find_folds()
        self._make_sums()
        self.changes += 1

    def _find_folds(self) -> None:
        """Nodes behind and on the mirror planes, and what counts of each node."""
        share = np.ones(self.count)
        self._folds: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.mirrored: list[tuple[int, np.ndarray, np.ndarray, np.ndarray]] = []
        for plane in self.planes:
            behind, images, on_plane = self.ranks.cells.mirrored(plane.mirror)
            ghosts = np.concatenate((behind, on_plane)).astype(np.int32)
            self.mirrored.append((plane.mirror.axis, behind, images, on_plane))
            self._folds.append((ghosts, np.concatenate((images, on_plane)).astype(np.int32), plane.signs))
            share[behind] = 0.0
            share[on_plane] *= 0.5
        self._common = np.unique(np.concatenate([np.zeros(0, np.int32), *self.ranks.sharing.shared]))
        self.share, self._share_of_all = share, share[self._common]

    def _make_sums(self) -> None:
        """Sums over ranks by name, of columns of an array."""
        flat = None
        if self.ranks.bitwise:
            self.partial = aligned_zeros((self.cells, self.ranks.cells.stencil.shape[1], 8))
            flat = self.partial.reshape(-1, 8)
        wanted = {"motion": (self.motion, 0, 7)}
        if self.twice:
            wanted["again"] = (self.again, 0, 4)
        if self.warm:
            wanted |= {"capacity": (self.heat, 0, 2), "flow": (self.heat, 4, 5)}
        self._sums = {name: self.ranks.sum(*columns, tag, flat) for tag, (name, columns) in enumerate(wanted.items())}

    # --- what a step does with them ---------------------------------------------------------------------------------

    def clear(self, nodes: np.ndarray) -> None:
        """Zeros, before particles give anything to nodes."""
        nodes[: self.count] = 0.0
        if self.partial is not None:
            # cells without particles are not visited
            self.partial[~self.ranks.cells.occupied] = 0.0

    def sum(self, name: str) -> None:
        """Add up what all ranks' particles have given: "motion", "again", "capacity" or "flow"."""
        own = self._own_masses() if name == "motion" and len(self._common) else None
        with TALKING:
            self._sums[name].start()
            self._sums[name].finish()
        if own is not None:
            # a function of where particles are: which ranks list a node depends on where they were, too
            mass = self.motion[self._common, 3]
            self.share[self._common] = self._share_of_all * own / np.where(mass > 0.0, mass, 1.0)

    def _own_masses(self) -> np.ndarray:
        """What this rank's particles have given to the nodes that other ranks list as well [kg]."""
        if self.partial is None:
            return np.asarray(self.motion[self._common, 3])
        slots, given = self.ranks.cells.stencil.ravel(), self.partial[:, :, 3].ravel()
        return np.bincount(slots, given, self.count)[self._common]

    def accelerate(self, step: float) -> None:
        """New velocities after a step [s], and their changes, from the sums of momentum and force."""
        self._fold(self.motion)
        kernels.update_nodes(0, self.count, self.motion, step, self._no_gravity, self.least_mass)
        if self.mass is not None:
            self._impulse = self.share[:, None] * self.motion[: self.count, 3:4] * self.motion[: self.count, 4:7]
            self.mass.solve(self, self.motion, 0)
            self.mass.solve(self, self.motion, 4)

    def divide_by_mass(self, nodes: np.ndarray) -> None:
        """Velocities of all ranks' momentum in an array (slots, 8), with lumped masses."""
        self._fold(nodes)
        kernels.find_velocities(0, self.count, nodes, self.least_mass)

    def find_velocities(self) -> None:
        """Velocities of the momentum that was mapped back."""
        self.divide_by_mass(self.again)
        if self.mass is not None:
            self.mass.solve(self, self.again, 0)

    def kinetic_gain(self) -> float:
        """What the step has added to the nodes' kinetic energy [J], on this rank."""
        if self.mass is not None:
            mean = self.motion[: self.count, :3] - 0.5 * self.motion[: self.count, 4:7]
            return in_turn(self._impulses() * mean)
        return float(kernels.kinetic_gain(0, self.count, self.motion, self.share))

    def energy_of_changes(self) -> float:
        """sum_i m_i a_i^2 / 2 [J] of the nodes' changes of velocity in the step, on this rank."""
        if self.mass is not None:
            return 0.5 * in_turn(self._impulses() * self.motion[: self.count, 4:7])
        return float(kernels.energy_of_changes(0, self.count, self.motion, self.share))

    def energy_of_mapping_back(self) -> float:
        """sum_i m_i a_i . (v_i - u_i) / 2 [J] on this rank, u_i the velocities of the momentum that was mapped back."""
        return 0.5 * in_turn(self._impulses() * (self.motion - self.again)[: self.count, :3])

    def _impulses(self) -> np.ndarray:
        """m_i a_i (count, 3) [N s] as far as this rank counts them; of the forces, if masses are not lumped."""
        if self.mass is not None:
            return self._impulse
        return (self.share * self.motion[: self.count, 3])[:, None] * self.motion[: self.count, 4:7]

    def _fold(self, nodes: np.ndarray) -> None:
        """Add what the body's images give."""
        for ghosts, images, signs in self._folds:
            kernels.fold_mirror(ghosts, images, signs, nodes)

    def spread(self, nodes: np.ndarray) -> None:
        """Give nodes behind mirror planes the reflected velocities."""
        for ghosts, images, signs in reversed(self._folds):
            kernels.spread_mirror(ghosts, images, signs, nodes)

    @property
    def bytes_sent(self) -> int:
        """Bytes this rank sends in the sums of a step."""
        return sum(each.bytes_sent for each in self._sums.values())

    def arrays(self) -> list[np.ndarray]:
        """Arrays that count as memory."""
        partial = [] if self.partial is None else [self.partial]
        series = [] if self.mass is None else self.mass.arrays()
        return [self.motion, self.again, self.heat, *partial, *series]
