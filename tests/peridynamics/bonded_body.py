"""A body of bonds on any number of ranks, made without the package's own set-up, and what it should do, by loops."""

import numpy as np

from decomposition.halo import Halo
from decomposition.neighbours import half_pairs
from parsolid.boundary.mirror_planes import MirrorCodes, MirrorPlane
from parsolid.methods.peridynamics.bond_damage import BondDamage, Limits
from parsolid.numerics.layout import LAYOUT
from parsolid.pairs.lists import Images, InnerList, OneSidedList, images_of, mutual
from parsolid.pairs.terms import KINEMATICS
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field

REACH = 2.3
# damage alone kills no particle
IMMORTAL = Limits(0.0, 1.0)
SHAPE = {2: (9, 8), 3: (6, 5, 6)}


def lattice(dimension: int, jitter: float = 0.2):
    """Positions (n, d) of cells of size 1, jittered, with identifiers in a shuffled order."""
    random = np.random.default_rng(3)
    cells = np.stack(np.meshgrid(*(np.arange(count) for count in SHAPE[dimension]), indexing="ij"), axis=-1)
    positions = cells.reshape(-1, dimension) + 0.5 + jitter * random.uniform(-1.0, 1.0, (cells[..., 0].size, dimension))
    return positions, random.permutation(len(positions))


class BondedBody:
    """Bond lists of the rank's share (by x), with mirror images in the plane y = 0 where asked for."""

    def __init__(self, comm, dimension: int, mirror: bool = False, kind: str = "roller", limits=IMMORTAL, jitter=0.2):
        self.comm, self.dimension = comm, dimension
        positions, identifiers = lattice(dimension, jitter)
        mine = (
            np.floor(positions[:, 0] / SHAPE[dimension][0] * comm.size).astype(int).clip(0, comm.size - 1) == comm.rank
        )
        self.owned = int(mine.sum())
        halo = Halo.plan(comm, positions[mine], REACH)
        self.halo, self.positions = halo, halo.with_ghosts(positions[mine])
        self.identifier = halo.with_ghosts(identifiers[mine].astype(np.int64))
        self.volume = 1.0 + 0.01 * self.identifier
        self.columns = KINEMATICS[dimension]
        self.particles = Particles(np.zeros(self.owned, np.int64))
        self.particles.attach(halo)
        told = {"ghosts": "forward", "message": "reference"}
        self.particles.declare(Field("kinematics", self.columns.width, "", **told))
        self.particles.declare(Field("identifier", 1, "1", whole=True, **told), identifiers[mine])
        self.particles.update("reference")
        self.kinematics = self.particles.storage("kinematics")
        place = slice(self.columns.reference, self.columns.reference + dimension)
        self.kinematics[: len(self.positions), place] = self.positions
        self.bonds = [self._direct(True)]
        if halo.ghosts:
            self.bonds.append(self._direct(False))
        if mirror:
            self.bonds.append(self._mirrored(kind))
        self.space = LAYOUT[dimension]
        self.weights = self
        self.refresh(self)
        self.damage = BondDamage(comm, self.particles, self, np.ones(self.owned), limits)
        self.particles.update("motion")

    def lists(self):
        """As `PairSystem.lists`, but for where neighbours stand."""
        return [(pairs, None) for pairs in self.bonds]

    def refresh(self, system, particles=None) -> None:
        """As `RadialWeights.refresh`: K (owned, d, d) by loops, its determinant and its inverse; of all particles."""
        shape = np.zeros((len(self.positions), self.dimension, self.dimension))
        for pairs in self.bonds:
            row = np.repeat(np.arange(self.owned), np.diff(pairs.start))
            end = self.positions[pairs.neighbour].copy()
            if images_of(pairs) is not None:
                end[:, 1] *= -1.0
            x = end - self.positions[row]
            terms = pairs.weight[:, None, None] * x[:, :, None] * x[:, None, :]
            np.add.at(shape, row, terms)
            if mutual(pairs):
                np.add.at(shape, pairs.neighbour, terms)
        self.shape = shape[: self.owned] / self.volume[: self.owned, None, None]
        self.determinant, self.inverse_shape = np.linalg.det(self.shape), np.linalg.pinv(self.shape)

    def _direct(self, inner: bool) -> InnerList | OneSidedList:
        start, neighbour = half_pairs(self.positions, self.owned, REACH)
        row = np.repeat(np.arange(self.owned), np.diff(start))
        keep = (neighbour < self.owned) == inner
        return self._list(row[keep], neighbour[keep], None, inner)

    def _mirrored(self, kind: str) -> InnerList | OneSidedList:
        d = self.dimension
        codes = MirrorCodes.of([MirrorPlane(1, 0.0, kind)], 1e-9)
        image = self.positions.copy()
        image[:, 1] *= -1.0
        apart = np.linalg.norm(image[None, :, :] - self.positions[: self.owned, None, :], axis=2)
        row, neighbour = np.nonzero(apart < REACH)
        return self._list(row, neighbour, Images(np.zeros(len(row), np.int8), codes.table(d)), False)

    def _list(self, row, neighbour, images, inner) -> InnerList | OneSidedList:
        start = np.concatenate(([0], np.cumsum(np.bincount(row, minlength=self.owned)))).astype(np.int64)
        end = self.positions[neighbour].copy()
        if images is not None:
            end[:, 1] *= -1.0
        distance = np.linalg.norm(end - self.positions[row], axis=1)
        weight = (1.0 - distance / (2.0 * REACH)) * self.volume[row] * self.volume[neighbour]
        columns = (start, neighbour.astype(np.int32), weight)
        return InnerList(*columns) if inner else OneSidedList(*columns, images)

    def displace(self, field) -> None:
        """Set the displacement to field(X) -> (n, d)."""
        first = self.columns.position
        self.kinematics[: len(self.positions), first : first + self.dimension] = field(self.positions)

    def directed(self) -> dict[tuple[int, int, bool], float]:
        """All bonds of all ranks: (identifier, identifier of the neighbour, is it an image) -> weight."""
        result = {}
        for pairs in self.bonds:
            row = np.repeat(np.arange(self.owned), np.diff(pairs.start))
            for a, b, weight in zip(row, pairs.neighbour, pairs.weight):
                ends = (int(self.identifier[a]), int(self.identifier[b]))
                result[(*ends, images_of(pairs) is not None)] = float(weight)
                if mutual(pairs):
                    result[(*ends[::-1], False)] = float(weight)
        return {key: weight for piece in self.comm.allgather(result) for key, weight in piece.items()}

    def of_owned(self, values: np.ndarray) -> dict[int, np.ndarray]:
        """identifier -> value, over all ranks."""
        mine = {int(identifier): values[i] for i, identifier in enumerate(self.identifier[: self.owned])}
        return {key: value for piece in self.comm.allgather(mine) for key, value in piece.items()}
