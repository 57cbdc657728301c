"""Faults of particles, which every rank finds for itself, told by all ranks together."""

from collections.abc import Sequence

from mpi4py import MPI

from parsolid.scene.validation_errors import SceneError

# faults that are told at most
_MOST = 50


def agree(comm: MPI.Comm, faults: Sequence[str]) -> None:
    """Raise the same SceneError on every rank when any rank has a fault (collective).

    The first ones alone are passed on, so that a fault of every particle does not flood the ranks.
    """
    if comm.allreduce(len(faults)) == 0:
        return
    mine = list(dict.fromkeys(faults[:_MOST]))
    raise SceneError(comm.allreduce(mine, lambda one, other: list(dict.fromkeys(one + other))[:_MOST]))
