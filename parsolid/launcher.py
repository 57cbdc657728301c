"""Runs as programs of their own on several ranks, and ranks that a launcher has started."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from mpi4py import MPI

import parsolid
from parsolid.collective import SolverError
from parsolid.exit_status import BAD_INPUT

# set by a launcher for the ranks it starts; a program that has them is a rank
_RANK_MARKS = ("PMI_RANK", "PMIX_RANK", "OMPI_COMM_WORLD_RANK", "MPI_LOCALRANKID")
# what makes a program believe that it is a rank of the job that started it
_OF_A_JOB = ("PMI_", "PMIX_", "OMPI_", "MPICH_", "HYDRA_", "HYDI_", "PRTE_", "MPI_LOCAL")
# how many processes a launcher has started, and the number of this one
_SIZES = (
    ("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"),
    ("PMI_SIZE", "PMI_RANK"),
    ("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"),
)


def launcher(ranks: int) -> list[str]:
    """The words before a program that start it on ranks: none for one rank, else the mpirun that belongs to this MPI.

    Raises SolverError when there is no mpirun.
    """
    if ranks == 1:
        return []
    beside = Path(sys.executable).with_name("mpirun")
    found = str(beside) if beside.exists() else shutil.which("mpirun") or shutil.which("mpiexec")
    if found is None:
        raise SolverError(f"ranks: expected mpirun or mpiexec on the PATH for {ranks} ranks, found neither")
    command = [found, "-n", str(ranks)]
    # Open MPI starts no more ranks than cores, and none for the superuser of a container, unless told to
    return [*command, "--oversubscribe", "--allow-run-as-root"] if MPI.get_vendor()[0] == "Open MPI" else command


def environment() -> dict[str, str]:
    """The environment of a program that is no rank of this one's job, with the same package in front."""
    values = {
        name: value for name, value in os.environ.items() if not name.startswith(_OF_A_JOB) or "_ALLOW_RUN_AS_" in name
    }
    root = str(Path(parsolid.__file__).resolve().parent.parent)
    return values | {"PYTHONPATH": os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])}


def start(arguments: Sequence[str], ranks: int, **pipes: Any) -> subprocess.Popen[Any]:
    """Start `parsolid` with arguments on ranks, in a session of its own, so that signals reach it through us alone.

    pipes: stdin, stdout, stderr and text of subprocess.Popen. Raises SolverError when there is no mpirun.
    """
    command = [*launcher(ranks), sys.executable, "-m", "parsolid", *arguments]
    return subprocess.Popen(command, env=environment(), start_new_session=True, **pipes)


def stop(job: subprocess.Popen[Any]) -> None:
    """Ask a run to write a checkpoint and stop, with the signal that launchers pass on to their ranks."""
    with suppress(ProcessLookupError):
        job.send_signal(signal.SIGUSR1)


def run_on_ranks(comm: MPI.Comm, arguments: list[str], ranks: int) -> int:
    """Run `parsolid` with the same arguments, without --ranks, on ranks; its exit status.

    SIGTERM, SIGUSR1 and Ctrl-C ask it to stop with a checkpoint, Ctrl-C for a second time ends it at once. Raises
    SolverError when started by an MPI launcher, or where there is none.
    """
    refuse_ranks(comm, "run --ranks")
    kept = [word for word, before in zip(arguments, ["", *arguments]) if "--ranks" not in (word, before)]
    job = start([word for word in kept if not word.startswith("--ranks=")], ranks)
    stopped: list[int] = []

    def pass_on(number: int, frame: object) -> None:
        if number == signal.SIGINT and number in stopped:
            os.killpg(job.pid, signal.SIGKILL)
        stopped.append(number)
        stop(job)

    for number in (signal.SIGTERM, signal.SIGUSR1, signal.SIGINT):
        signal.signal(number, pass_on)
    return job.wait()


def refuse_ranks(comm: MPI.Comm, command: str) -> None:
    """Raise SolverError on all ranks when a command that starts ranks itself was started by an MPI launcher."""
    if comm.size > 1 or any(mark in os.environ for mark in _RANK_MARKS):
        expected = "expected to be started without mpirun (it starts its runs on ranks itself)"
        raise SolverError(f"{command}: {expected}, found a launcher")


def refuse_strangers(comm: MPI.Comm) -> None:
    """Raise SolverError in the first of processes that a launcher has started as ranks and MPI takes for one each.

    They would all do the whole run. The others end with the same status and no word.
    """
    names = next((pair for pair in _SIZES if os.environ.get(pair[0], "").isdigit()), None)
    if comm.size > 1 or names is None or int(os.environ[names[0]]) < 2:
        return
    if os.environ.get(names[1], "0") != "0":
        raise SystemExit(BAD_INPUT)
    started = os.environ[names[0]]
    library = MPI.Get_library_version().strip("\0").splitlines()[0].split(",")[0].strip()
    raise SolverError(
        f"expected the {started} ranks that the launcher has started ({names[0]}), found that each is alone: mpi4py "
        f"uses {library}, the launcher another MPI; take the mpirun that belongs to it, srun --mpi=pmi2 or --mpi=pmix, "
        f"or choose with MPI4PY_MPIABI=mpich or openmpi (where runs of their own are meant: env -u {names[0]})"
    )
