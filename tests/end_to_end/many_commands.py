"""mpirun -n 2 python many_commands.py FOLDER: runs the command lines of FOLDER/commands.json, keeping what each rank
prints.
"""

import json
import os
import sys
import time
from pathlib import Path

from mpi4py import MPI

from parsolid.commands.cli import main


def captured(command: list[str], stem: Path) -> dict:
    """Run one command with this rank's output in files."""
    kept = os.dup(1), os.dup(2)
    paths = stem.with_suffix(".out"), stem.with_suffix(".err")
    for number, path in enumerate(paths, 1):
        sys.stdout.flush()
        sys.stderr.flush()
        with open(path, "w") as file:
            os.dup2(file.fileno(), number)
    began = time.perf_counter()
    try:
        status = main(command)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, descriptor in enumerate(kept, 1):
            os.dup2(descriptor, number)
            os.close(descriptor)
    seconds = time.perf_counter() - began
    return {"status": status, "out": paths[0].read_text(), "err": paths[1].read_text(), "seconds": seconds}


def run_all(folder: Path) -> None:
    rank = MPI.COMM_WORLD.rank
    for number, command in enumerate(json.loads((folder / "commands.json").read_text())):
        MPI.COMM_WORLD.Barrier()
        ended = captured(command, folder / f"{number}.{rank}.captured")
        (folder / f"{number}.{rank}.json").write_text(json.dumps(ended))


run_all(Path(sys.argv[1]))
