"""Writes checkpoints and fields as fast as it can until it is killed, or the process NUMBER has ended, which wants it:
mpirun -n 2 python endless_writer.py DIRECTORY NUMBER.

Every state is a function of the step alone, so that whoever reads a file knows what must be in it.
"""

import os
import sys
from pathlib import Path

import numpy as np

PARTICLES = 20_000


def state(step: int, identifier: np.ndarray) -> dict[str, np.ndarray]:
    """What the particles hold at a step."""
    position = np.sqrt(identifier[:, np.newaxis] + np.arange(3.0)) + 0.1 * step
    return {"identifier": identifier, "position": position, "jacobian": 1.0 / (1.0 + identifier + step)}


def is_there(process: int) -> bool:
    """Whether a process of this user runs."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def main(directory: Path, wanted_by: int) -> None:
    from mpi4py import MPI

    from decomposition.migration import migrate
    from parsolid.output import OutputError
    from parsolid.output.checkpoint import find_checkpoint, read_checkpoint, write_checkpoint
    from parsolid.output.fields import FieldSeries

    comm = MPI.COMM_WORLD
    identifier = np.arange(comm.rank, PARTICLES, comm.size)
    step, resume_at = 0, None
    try:
        header, (fields,), _ = read_checkpoint(comm, find_checkpoint(directory, comm))
    except OutputError:
        pass  # the first run
    else:
        identifier, step, resume_at = fields["identifier"], header["step"], 0.5 * header["step"]
    # room for a few steps only, so that files are also filled and followed by others under fire
    series = FieldSeries(comm, directory / "fields.vtkhdf", 40, resume_at)
    # what is compiled or loaded at its first use is so before the killing begins
    migrate(comm, identifier % comm.size, {"identifier": identifier})
    processes = comm.gather(os.getpid())
    if comm.rank == 0:
        (directory / "processes.partial").write_text(" ".join(map(str, processes)))
        os.replace(directory / "processes.partial", directory / "processes")
    while is_there(wanted_by):
        step += 1
        now = state(step, identifier)
        series.write(0.5 * step, identifier, now["position"], {"jacobian": now["jacobian"]}, {"identifier": identifier})
        write_checkpoint(comm, directory / "checkpoint.h5", {"step": step}, [now], np.array([step + comm.rank / 7.0]))
    # the others may have seen it still there, and be waiting for this rank
    comm.Abort(1)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
