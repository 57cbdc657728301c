"""A mesh read by one rank, of which every rank gets its own particles alone."""

import time
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.bodies import FilledShape
from parsolid.scene.mesh import MeshFilling
from parsolid.scene.mesh_inside import Solid
from parsolid.scene.named_regions import Region
from parsolid.scene.validation_errors import SceneError

_READER = 0
# places that the reader looks for at once
_TOGETHER = 100_000
# parts of a `ParticleSet` that travel
_ARRAYS = ("identifier", "position", "volume", "spacing", "body", "area", "regions", "surfaces")


def _wait(comm: MPI.Comm) -> None:
    """Until all ranks are here, without the processor that the reader may need; collective."""
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(0.002)


class MeshPieces:
    """The particles of a mesh: a filling whose `piece` is what `deliver` has brought to this rank.

    groups: names of those that the mesh has.
    """

    count: int
    lower: np.ndarray
    upper: np.ndarray
    coarsest: float

    def __init__(self, comm: MPI.Comm, body: FilledShape, dimension: int):
        """Raises SceneError, on all ranks, for a mesh that cannot be used. Collective."""
        self.comm, self.dimension = comm, dimension
        self._whole: MeshFilling | None = None
        self._solid: Solid | None = None
        self._mine: ParticleSet | None = None
        told: Any = None
        if comm.rank == _READER:
            try:
                whole = self._whole = MeshFilling(body, dimension)
                told = (whole.count, whole.lower, whole.upper, whole.coarsest, sorted(whole.groups.names))
            except SceneError as error:
                told = error.faults
        _wait(comm)
        told = comm.bcast(told, _READER)
        if isinstance(told, list):
            raise SceneError(told)
        self.count, self.lower, self.upper, self.coarsest, self.groups = told

    def mark(self, known: dict[str, Region]) -> None:
        """Find the particles in regions; collective."""
        if self._whole is not None:
            self._whole.mark(known)
        _wait(self.comm)

    def deliver(self, first: int, last: int, regions: int) -> None:
        """Bring particles first .. last-1 to this rank, which forgets the rest; regions: how many have a name.
        Collective."""
        ranges = self.comm.gather((first, max(first, last)), _READER)
        if self._whole is not None:
            assert ranges is not None
            for rank in [*range(_READER + 1, self.comm.size), _READER]:
                piece = self._whole.piece(*ranges[rank])
                if rank != _READER:
                    self._send(piece, rank)
            self._mine, self._solid, self._whole = piece, self._whole.solid, None
        else:
            self._mine = self._received(max(last - first, 0), regions)
        self._first = first

    def inside(self, places: np.ndarray, margin: float) -> int:
        """How many places (n, d) of this rank are in the mesh, farther from its surface than a margin [m].

        The reader looks for those of each rank in turn. Collective.
        """
        places = np.ascontiguousarray(places[((places > self.lower) & (places < self.upper)).all(axis=1)])
        many = self.comm.gather(len(places), _READER)
        if self._solid is None:
            for first in range(0, len(places), _TOGETHER):
                self.comm.Send(places[first : first + _TOGETHER], _READER)
            return int(self.comm.scatter(None, _READER))
        assert many is not None
        found = [int(self._solid.inside(places, margin).sum())]
        for rank, count in [*enumerate(many)][1:]:
            found.append(0)
            for first in range(0, count, _TOGETHER):
                piece = np.empty((min(_TOGETHER, count - first), self.dimension))
                self.comm.Recv(piece, rank)
                found[-1] += int(self._solid.inside(piece, margin).sum())
        return int(self.comm.scatter(found, _READER))

    def _send(self, piece: ParticleSet, rank: int) -> None:
        for name in _ARRAYS:
            values = getattr(piece, name)
            if values is not None:
                self.comm.Send(np.ascontiguousarray(values), rank)

    def _received(self, count: int, regions: int) -> ParticleSet:
        d = self.dimension
        vectors = [np.empty((count, d)) for _ in range(3)]
        identifier, volume, body = np.empty(count, np.int64), np.empty(count), np.empty(count, np.int32)
        piece = ParticleSet(identifier, vectors[0], volume, vectors[1], None, body, vectors[2])
        if regions:
            piece.regions, piece.surfaces = np.empty((count, regions), np.int64), np.empty((count, regions * d))
        for name in _ARRAYS:
            if getattr(piece, name) is not None:
                self.comm.Recv(getattr(piece, name), _READER)
        return piece

    def piece(self, first: int, last: int) -> ParticleSet:
        """What `deliver` has brought."""
        assert self._mine is not None and (first, len(self._mine)) == (self._first, last - first)
        return self._mine
