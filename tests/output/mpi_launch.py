"""Start programs from within a test, alone or on several ranks, whichever MPI this is."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from mpi4py import MPI

_INHERITED = (
    "PMI_",
    "PMIX_",
    "OMPI_COMM",
    "OMPI_UNIVERSE",
    "OMPI_MCA_orte",
    "OMPI_MCA_ess",
    "HYDRA",
    "HYDI",
    "MPI_LOCAL",
)


def clean_environment() -> dict[str, str]:
    """The environment without what would make a new program believe it is a rank of this run."""
    return {name: value for name, value in os.environ.items() if not name.startswith(_INHERITED)}


def launcher(ranks: int) -> list[str]:
    """The command that starts a program on some ranks: the mpirun that belongs to this MPI."""
    beside = Path(sys.executable).with_name("mpirun")
    command = [str(beside) if beside.exists() else shutil.which("mpirun") or "mpirun", "-n", str(ranks)]
    return [*command, "--oversubscribe", "--allow-run-as-root"] if MPI.get_vendor()[0] == "Open MPI" else command


def start(arguments: list, ranks: int = 1, **options) -> subprocess.Popen:
    """Run this Python with arguments on some ranks, as a process block of its own."""
    command = [*launcher(ranks), sys.executable, *map(str, arguments)]
    return subprocess.Popen(command, env=clean_environment(), start_new_session=True, **options)
