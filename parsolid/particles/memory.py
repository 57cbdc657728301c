"""Whether so many particles can fit into the memory of the machines at all, told before any is made."""

from pathlib import Path

from mpi4py import MPI

from parsolid.collective import minimum
from parsolid.scene.validation_errors import SceneError

# no method needs less for a particle with its fields, lists and work arrays [bytes]
LEAST_BYTES = 300

# limits of groups of processes, version 2 and 1
_GROUPS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")


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


def free_bytes() -> float:
    """Memory that this machine, or the group of processes that this one is in, can still give; inf where unknown."""
    found = [float("inf")]
    try:
        lines = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
        found.append(1024.0 * int(lines["MemAvailable"].split()[0]))
    except (OSError, KeyError, ValueError):
        pass  # not Linux
    for limit in _GROUPS:
        try:
            # all of it: what files take of it is given back when it is needed
            found.append(float(Path(limit).read_text()))
        except (OSError, ValueError):
            continue  # no such group, or "max"
    return max(0.0, min(found))
