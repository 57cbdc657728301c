"""Run parsolid's command line as a user does: in processes of its own, on any number of ranks."""

import contextlib
import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI

LONGEST = 300.0
ROOT = Path(__file__).resolve().parents[2]
_OPEN_MPI = MPI.get_vendor()[0] == "Open MPI"
# what would make a new program believe that it is a rank of the job that runs the tests
_INHERITED = ("PMI_", "PMIX_", "OMPI_", "PRTE_", "HYDRA", "HYDI", "MPI_LOCAL")


@dataclass
class Result:
    """How a command ended: exit status, what it printed, seconds it took."""

    status: int
    out: str
    err: str
    seconds: float = 0.0


def environment() -> dict[str, str]:
    """The environment for a job that has nothing to do with the one that runs the tests."""
    values = {name: value for name, value in os.environ.items() if not name.startswith(_INHERITED)}
    values["PYTHONPATH"] = os.pathsep.join([str(ROOT), *filter(None, [values.get("PYTHONPATH")])])
    if _OPEN_MPI:
        values |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    return values


def launcher(ranks: int) -> list[str]:
    """The command that starts a program on some ranks: the mpirun that belongs to this MPI."""
    beside = Path(sys.executable).with_name("mpirun")
    command = [str(beside) if beside.exists() else shutil.which("mpirun") or "mpirun", "-n", str(ranks)]
    return [*command, "--oversubscribe"] if _OPEN_MPI else command


def start(arguments: list, ranks: int = 2, folder: Path | None = None, program=("-m", "parsolid")) -> subprocess.Popen:
    """Begin a command; stdout and stderr are pipes."""
    command = [*launcher(ranks), sys.executable, *map(str, program), *map(str, arguments)]
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, env=environment(), cwd=folder, text=True, start_new_session=True, **pipes)


def finish(job: subprocess.Popen, longest: float = LONGEST) -> Result:
    """Wait for a job; one that takes too long is killed and fails the test."""
    began = time.monotonic()
    try:
        out, err = job.communicate(timeout=longest)
    except subprocess.TimeoutExpired:
        kill(job)
        out, err = job.communicate()
        raise AssertionError(f"{job.args} did not end within {longest:.0f} s\n{out}\n{err}") from None
    return Result(job.returncode, out, err, time.monotonic() - began)


def parsolid(*arguments, ranks: int = 2, folder: Path | None = None, expect: int | None = 0) -> Result:
    """Run a command to its end; `expect` is the exit status it must have (None: any)."""
    result = finish(start(list(arguments), ranks, folder))
    assert expect is None or result.status == expect, f"exit status {result.status}\n{result.out}\n{result.err}"
    return result


class Crew:
    """Ranks that run one list of commands after another: what they have imported and loaded serves all of them."""

    def __init__(self, ranks: int):
        self.ranks, self.given = ranks, 0
        self.folder = Path(tempfile.mkdtemp(prefix="parsolid-crew-"))
        (self.folder / "jobs").touch()
        words = (Path(__file__).with_name("many_commands.py"),)
        self.job = start([self.folder, os.getpid()], ranks, self.folder, words)

    def run(self, folder: Path) -> None:
        """Run the commands of a folder; a crew that ends or takes too long fails the test."""
        with (self.folder / "jobs").open("a") as file:
            file.write(f"{folder}\n")
        wait_for(lambda: all((folder / f"done.{rank}").exists() for rank in range(self.ranks)), self.job)

    def end(self) -> None:
        """Let the ranks go home."""
        if self.job.poll() is None:
            with (self.folder / "jobs").open("a") as file:
                file.write("end\n")
            finish(self.job)
        shutil.rmtree(self.folder)


# by their number of ranks; larger crews are not kept, for their memory
_CREWS: dict[int, Crew] = {}
_KEPT = (1, 2)


def end_crews() -> None:
    """End the crews that are there."""
    while _CREWS:
        _CREWS.popitem()[1].end()


def many(commands: list[list], ranks: int, folder: Path, alone: bool = False) -> list[list[Result]]:
    """Run commands one after the other in one job, which starts only once, or was there before.

    For each command the results of all ranks. alone: in a job of their own.
    """
    folder.mkdir(parents=True)
    (folder / "commands.json").write_text(json.dumps([[str(word) for word in command] for command in commands]))
    crew = Crew(ranks) if alone or ranks not in _CREWS else _CREWS.pop(ranks)
    crew.run(folder)
    if alone or ranks not in _KEPT:
        crew.end()
    else:
        _CREWS[ranks] = crew
    results = []
    for number in range(len(commands)):
        ended = [json.loads((folder / f"{number}.{rank}.json").read_text()) for rank in range(ranks)]
        results.append([Result(**entry) for entry in ended])
    return results


def all_done(results: list[list[Result]]) -> None:
    """Assert that every command ended well on every rank."""
    for ranks in results:
        assert [rank.status for rank in ranks] == [0] * len(ranks), "\n".join(rank.err for rank in ranks)


def descendants(process: int) -> list[int]:
    """Identifiers of all processes below one (Linux)."""
    parents = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            # "pid (name) state parent ...": the name may hold anything but its closing bracket is the last one
            parents[int(entry.parent.name)] = int(entry.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue  # gone meanwhile
    found, layer = [], [process]
    while layer:
        layer = [child for child, parent in parents.items() if parent in layer]
        found += layer
    return found


def ranks_of(job: subprocess.Popen) -> list[int]:
    """Identifiers of the processes of a job that run Python."""
    found = []
    for process in descendants(job.pid):
        try:
            words = Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if words[0].endswith(Path(sys.executable).name.encode()) and b"parsolid" in words:
            found.append(process)
    return found


def kill(job: subprocess.Popen) -> None:
    """Kill all processes of a job at once, as a power cut does."""
    for process in [*descendants(job.pid), job.pid]:
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


def wait_for(condition, job: subprocess.Popen, longest: float = LONGEST):
    """Wait until condition() is true and return its value; fails when the job ends before."""
    end = time.monotonic() + longest
    while not (value := condition()):
        if job.poll() is not None or time.monotonic() > end:
            kill(job)
            out, err = job.communicate()
            raise AssertionError(f"the job ended too early, with {job.returncode}\n{out}\n{err}")
        time.sleep(0.005)
    return value


def wait_until_free(folder: Path, longest: float = LONGEST) -> None:
    """Wait until no process has a folder of results: one of a job that has ended may take a moment to be gone."""
    end = time.monotonic() + longest
    while time.monotonic() < end:
        with contextlib.suppress(FileNotFoundError), (folder / "run.lock").open() as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                time.sleep(0.005)
                continue
        return
