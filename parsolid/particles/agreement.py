"""One error on all ranks for the faults that single ranks find in their particles."""

from collections.abc import Sequence

from mpi4py import MPI

from parsolid.scene.validation_errors import SceneError

# most faults in a message
_MOST = 50


def agree(comm: MPI.Comm, faults: Sequence[str]) -> None:
    """Raise one SceneError on every rank when any rank has faults; only the first faults are sent. Collective."""
    if comm.allreduce(len(faults)) == 0:
        return
    mine = list(dict.fromkeys(faults[:_MOST]))
    raise SceneError(comm.allreduce(mine, lambda first, second: list(dict.fromkeys(first + second))[:_MOST]))
