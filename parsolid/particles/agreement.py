"""Faults of particles, which every rank finds for itself, told by all ranks together."""

from collections.abc import Sequence

from mpi4py import MPI

from parsolid.scene.validation_errors import SceneError


def agree(comm: MPI.Comm, faults: Sequence[str]) -> None:
    """Raise the same SceneError on every rank when any rank has a fault (collective).

    A rank passes on its first faults only, so that a fault of every particle does not flood the ranks.
    """
    if comm.allreduce(len(faults)) == 0:
        return
    every = [fault for piece in comm.allgather(faults[:50]) for fault in piece]
    raise SceneError(dict.fromkeys(every))
