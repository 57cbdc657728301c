"""mpirun -n 2 python many_commands.py FOLDER PROCESS: runs command lines, keeping what each rank prints.

A line of FOLDER/jobs names a folder whose commands.json is run next; the line "end" ends the job, and so does the end
of PROCESS.
"""

import json
import os
import sys
import time
from pathlib import Path

from mpi4py import MPI

from parsolid.commands.cli import main

# between two looks for the next job, in seconds
GLANCE = 0.005


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
    os.chdir(folder)
    for number, command in enumerate(json.loads((folder / "commands.json").read_text())):
        MPI.COMM_WORLD.Barrier()
        ended = captured(command, folder / f"{number}.{rank}.captured")
        (folder / f"{number}.{rank}.json").write_text(json.dumps(ended))
    (folder / f"done.{rank}").touch()


def next_job(path: Path, number: int, process: int) -> str:
    """The line of a number, waited for without keeping the processor busy."""
    while Path(f"/proc/{process}").exists():
        # a line is there when its end is
        lines = path.read_text().split("\n")[:-1]
        if len(lines) > number:
            return lines[number]
        time.sleep(GLANCE)
    return "end"


def serve(folder: Path, process: int) -> None:
    number = 0
    while (job := next_job(folder / "jobs", number, process)) != "end":
        run_all(Path(job))
        number += 1


serve(Path(sys.argv[1]), int(sys.argv[2]))
