"""Whether so many particles can fit into the memory of the machines at all, told before any is made."""

from mpi4py import MPI

from parsolid.collective import minimum
from parsolid.machine import free_bytes
from parsolid.scene.validation_errors import SceneError

# no method needs less for a particle with its fields, lists and work arrays [bytes]
LEAST_BYTES = 300


def check_memory(comm: MPI.Comm, particles: int) -> None:
    """Raise SceneError, on all ranks, when their memory is too small for so many particles; collective."""
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = free_bytes() / machine.size
    machine.Free()
    room = minimum(comm, share) * comm.size
    needed = particles * LEAST_BYTES
    if needed > room:
        free = f"the {room / 2**30:.3g} GiB of memory which are free on {comm.size} rank{'s' * (comm.size > 1)}"
        found = f"{particles:,}, which take at least {needed / 2**30:.3g} GiB"
        raise SceneError([f"bodies: expected particles that fit into {free}, found {found}"])
