"""A body of bonds on any number of ranks, made without the package's own set-up, and what it should do, by loops."""

import numpy as np

from decomposition.halo import Halo
from decomposition.pair_search import half_pairs
from parsolid.boundary.mirror_planes import MirrorCodes, MirrorPlane
from parsolid.methods.peridynamics.bond_damage import BondDamage
from parsolid.methods.peridynamics.bonds import rows_in
from parsolid.methods.peridynamics.sweeps import BondList, Images
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field

REACH = 2.3
# damage alone kills no particle
IMMORTAL = (0.0, 1.0)
SHAPE = {2: (9, 8), 3: (6, 5, 6)}


def lattice(dimension: int, jitter: float = 0.2):
    """Positions (n, d) of cells of size 1, jittered, with identifiers in a shuffled order."""
    random = np.random.default_rng(3)
    cells = np.stack(np.meshgrid(*(np.arange(count) for count in SHAPE[dimension]), indexing="ij"), axis=-1)
    positions = cells.reshape(-1, dimension) + 0.5 + jitter * random.uniform(-1.0, 1.0, (cells[..., 0].size, dimension))
    return positions, random.permutation(len(positions))


class BondedBody:
    """Bond lists of the rank's share (by x), with mirror images in the plane y = 0 where asked for; what `BondDamage`
    asks of `bonds.Bonds`."""

    def __init__(self, comm, dimension: int, mirror: bool = False, kind: str = "roller", limits=IMMORTAL, jitter=0.2):
        """limits: least determinant and largest damage."""
        self.comm, self.dimension, self.d = comm, dimension, dimension
        positions, identifiers = lattice(dimension, jitter)
        mine = (
            np.floor(positions[:, 0] / SHAPE[dimension][0] * comm.size).astype(int).clip(0, comm.size - 1) == comm.rank
        )
        self.owned = int(mine.sum())
        halo = Halo(comm, positions[mine], REACH)
        self.halo, self.positions = halo, halo.with_ghosts(positions[mine])
        self.identifier = halo.with_ghosts(identifiers[mine].astype(np.int64))
        self.volume = 1.0 + 0.01 * self.identifier
        self.particles = Particles(np.zeros(self.owned, np.int64))
        self.particles.attach(halo)
        told = {"ghosts": "forward", "message": "reference"}
        self.particles.declare(Field("identifier", 1, "1", whole=True, **told), identifiers[mine])
        self.particles.declare(Field("inverse_shape", 6, "1", layout=Columns()))
        self.particles.update("reference")
        self.field = 2 * (dimension - 1)
        self.motion = np.zeros((len(self.positions), 2 * self.field))
        self.motion[:, :dimension] = self.positions
        self.lists = [self._direct(True)]
        if halo.ghosts:
            self.lists.append(self._direct(False))
        if mirror:
            self.lists.append(self._mirrored(kind))
        self.refresh_shapes(np.ones(self.owned, bool), self.lists)
        self.damage = BondDamage(self, np.ones(self.owned), *limits)
        self.particles.update("motion")

    def fill(self, name, first, last) -> None:
        """The motion is set by `displace`."""

    def leave_out_broken(self) -> None:
        """There is no lattice."""

    def motion_of(self, name) -> np.ndarray:
        """Rows of X and u."""
        return self.motion

    def refresh_shapes(self, chosen, lists) -> None:
        """As `Bonds.refresh_shapes`: K (owned, d, d) by loops, its determinant and its inverse; of all particles."""
        shape = np.zeros((len(self.positions), self.dimension, self.dimension))
        for bonds, images, mutual in self.lists:
            row = np.repeat(np.arange(self.owned), np.diff(bonds.start))
            end = self.positions[bonds.neighbour].copy()
            if images is not None:
                end[:, 1] *= -1.0
            x = end - self.positions[row]
            terms = bonds.weight[:, None, None] * x[:, :, None] * x[:, None, :]
            np.add.at(shape, row, terms)
            if mutual:
                np.add.at(shape, bonds.neighbour, terms)
        self.shape = shape[: self.owned] / self.volume[: self.owned, None, None]
        self.determinant = np.linalg.det(self.shape)
        inverse, d = np.linalg.pinv(self.shape), self.dimension
        pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
        six = np.stack([inverse[:, i, j] if max(i, j) < d else 0.0 * self.determinant for i, j in pairs], axis=1)
        self.particles.owned_rows("inverse_shape")[:] = six

    def _direct(self, inner: bool):
        start, neighbour = half_pairs(self.positions, self.owned, REACH)
        row = np.repeat(np.arange(self.owned), np.diff(start))
        keep = (neighbour < self.owned) == inner
        return self._list(row[keep], neighbour[keep], None), None, inner or None

    def _mirrored(self, kind: str):
        codes = MirrorCodes.of([MirrorPlane(1, 0.0, kind)], 1e-9)
        image = self.positions.copy()
        image[:, 1] *= -1.0
        apart = np.linalg.norm(image[None, :, :] - self.positions[: self.owned, None, :], axis=2)
        row, neighbour = np.nonzero(apart < REACH)
        tables = (rows_in(array, self.dimension) for array in (codes.signs, codes.reflections, codes.shifts))
        images = Images(np.zeros(len(row), np.int8), *tables)
        return self._list(row, neighbour, images), images, None

    def _list(self, row, neighbour, images) -> BondList:
        start = np.concatenate(([0], np.cumsum(np.bincount(row, minlength=self.owned)))).astype(np.int64)
        end = self.positions[neighbour].copy()
        if images is not None:
            end[:, 1] *= -1.0
        distance = np.linalg.norm(end - self.positions[row], axis=1)
        weight = (1.0 - distance / (2.0 * REACH)) * self.volume[row] * self.volume[neighbour]
        return BondList(start, neighbour.astype(np.uint32), weight)

    def displace(self, field) -> None:
        """Set the displacement to field(X) -> (n, d)."""
        self.motion[:, self.field : self.field + self.dimension] = field(self.positions)

    def directed(self) -> dict[tuple[int, int, bool], float]:
        """All bonds of all ranks: (identifier, identifier of the neighbour, is it an image) -> weight."""
        result = {}
        for bonds, images, mutual in self.lists:
            row = np.repeat(np.arange(self.owned), np.diff(bonds.start))
            for a, b, weight in zip(row, bonds.neighbour, bonds.weight):
                ends = (int(self.identifier[a]), int(self.identifier[b]))
                result[(*ends, images is not None)] = float(weight)
                if mutual:
                    result[(*ends[::-1], False)] = float(weight)
        return {key: weight for piece in self.comm.allgather(result) for key, weight in piece.items()}

    def of_owned(self, values: np.ndarray) -> dict[int, np.ndarray]:
        """identifier -> value, over all ranks."""
        mine = {int(identifier): values[i] for i, identifier in enumerate(self.identifier[: self.owned])}
        return {key: value for piece in self.comm.allgather(mine) for key, value in piece.items()}
