"""Ranks that a launcher has started and that do not find each other."""

import os

from mpi4py import MPI

from parsolid.collective import SolverError

# how many processes a launcher has started, and the number of this one
_MARKS = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
)


def refuse_strangers(comm: MPI.Comm) -> None:
    """Raise SolverError in the first of processes that a launcher has started as ranks and MPI takes for one each.

    They would all do the whole run. The others end with the same status and no word.
    """
    told = next((pair for pair in _MARKS if os.environ.get(pair[0], "").isdigit()), None)
    if comm.size > 1 or told is None or int(os.environ[told[0]]) < 2:
        return
    if os.environ.get(told[1], "0") != "0":
        raise SystemExit(2)
    started = os.environ[told[0]]
    library = MPI.Get_library_version().strip("\0").splitlines()[0].split(",")[0].strip()
    raise SolverError(
        f"expected the {started} ranks that the launcher has started ({told[0]}), found that each is alone: mpi4py "
        f"uses {library}, the launcher another MPI; take the mpirun that belongs to it, srun --mpi=pmi2 or --mpi=pmix, "
        f"or choose with MPI4PY_MPIABI=mpich or openmpi (where runs of their own are meant: env -u {told[0]})"
    )
