"""python -m checks.slurm_rehearsal: the batch scripts on a real Slurm of one node, started for it alone.

Needs root and the programs slurmctld, slurmd, munged and sbatch (Debian: slurmctld slurmd munge slurm-client). A job is
warned by its time limit and by hand, cancelled, put back by the administrator, killed; each time what it leaves at its
end has to be what an uninterrupted run leaves, to the last bit. A job array, and a scene that is refused.
Prints one line a case; status 1 when one failed.
"""

import argparse
import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "end_to_end"))

from command_line import environment, finish, launcher, start
from run_results import assert_same_bits, summary
from small_scenes import PUNCH, changed, write

ROOT = Path(__file__).parents[1]
PATIENCE = 600.0
CONFIGURATION = """
ClusterName=rehearsal
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort=16817
SlurmdPort=16818
ProctrackType=proctrack/pgid
TaskPlugin=task/none
ReturnToService=2
KillWait=20
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


@contextlib.contextmanager
def cluster(folder: Path) -> Iterator[dict[str, str]]:
    """A Slurm of this machine alone in a folder; the environment in which its commands find it."""
    for name in ("state", "spool"):
        (folder / name).mkdir()
    host = subprocess.run(["hostname", "-s"], capture_output=True, text=True, check=True).stdout.strip()
    (folder / "slurm.conf").write_text(CONFIGURATION.format(host=host, folder=folder))
    values = environment() | {"SLURM_CONF": str(folder / "slurm.conf")}
    values["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), values["PATH"], "/usr/sbin"])
    if subprocess.run(["pgrep", "munged"], capture_output=True, check=False).returncode != 0:
        subprocess.run(["install", "-d", "-o", "munge", "/run/munge"], check=True)
        subprocess.run(["runuser", "-u", "munge", "--", "munged"], env=values, check=True)
    daemons = [
        subprocess.Popen([name, "-D"], env=values, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for name in ("slurmctld", "slurmd")
    ]
    try:
        yield values
    finally:
        subprocess.run(["scancel", "--user=root"], env=values, check=False)
        time.sleep(2.0)
        for daemon in daemons:
            daemon.terminate()
            daemon.wait()


class Rehearsal:
    """Jobs in a folder; values: environment of the cluster's commands."""

    def __init__(self, folder: Path, values: dict[str, str], end_time: float) -> None:
        self.folder, self.values = folder, values
        self.values["PARSOLID_LAUNCH"] = " ".join(launcher(2))
        scene = changed(
            PUNCH,
            {
                "end_time": end_time,
                "bodies.0.particles": [33, 33],
                "output.checkpoint_steps": 200,
                "output.history_steps": 50,
            },
        )
        self.scene = write(changed(scene, {"output.fields_interval": end_time / 8}), folder / "scene.toml")
        self.whole = folder / "whole"
        done = finish(start([self.scene, "-q", "-o", self.whole], 2), PATIENCE)
        assert done.status == 0, done.err

    def slurm(self, *words: str) -> str:
        """What a command of Slurm prints."""
        done = subprocess.run(words, env=self.values, cwd=self.folder, capture_output=True, text=True, check=False)
        return done.stdout + done.stderr

    def submit(self, name: str, *options: str, scene: Path | None = None, script: str = "run.sbatch") -> str:
        """The number of a new job that writes to the folder of that name."""
        words = ["sbatch", f"--output={self.folder}/{name}.log", *options, str(ROOT / "slurm" / script)]
        more = [str(self.folder / "cases.txt")] if script == "study.sbatch" else ["-q"]
        said = self.slurm(*words, str(scene or self.scene), str(self.folder / name), *more)
        return re.search(r"batch job (\d+)", said)[1]

    def show(self, job: str, key: str) -> str:
        """One of the things that Slurm knows of a job."""
        found = re.search(rf"\b{key}=(\S+)", self.slurm("scontrol", "show", "job", job))
        return found[1] if found else ""

    def until(self, met: Callable[[], object], what: str) -> None:
        """Wait; a job that was put back need not wait its two minutes."""
        end = time.monotonic() + PATIENCE
        while not met():
            assert time.monotonic() < end, f"waited in vain until {what}"
            time.sleep(0.2)

    def runs(self, job: str, name: str, rows: int = 4) -> None:
        """Wait until a job has written so many more rows of its history."""
        history = self.folder / name / "history.csv"
        count = lambda: len(history.read_text().splitlines()) if history.exists() else 0  # noqa: E731
        before = count()

        def moved() -> bool:
            state = self.show(job, "JobState")
            assert state in ("PENDING", "CONFIGURING", "RUNNING"), f"{name}: {state} before it could be stopped"
            return state == "RUNNING" and count() >= before + rows

        self.until(moved, f"{name} runs")

    def again(self, job: str, restarts: int) -> None:
        """Let a job that was put back so often start now."""
        self.until(lambda: int(self.show(job, "Restarts") or 0) >= restarts, "it is put back")
        self.until(lambda: self.show(job, "JobState") == "PENDING", "it is in the queue")
        # what Slurm's two minutes are for: its daemon has to be done with the job
        time.sleep(10.0)
        self.slurm("scontrol", "update", f"JobId={job}", "StartTime=now")

    def ends(self, job: str, state: str = "COMPLETED") -> None:
        """Wait until a job has ended in a state."""
        over = ("COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL")
        self.until(lambda: self.show(job, "JobState") in over, "it ends")
        log = Path(self.show(job, "StdOut"))
        said = log.read_text()[-500:] if log.exists() else "no log"
        assert self.show(job, "JobState") == state, (
            f"{self.show(job, 'JobState')}, {self.show(job, 'ExitCode')}: {said}"
        )

    def kill(self, name: str) -> None:
        """SIGKILL to the ranks that write to the folder of that name, by their numbers."""
        wanted, found = str(self.folder / name), []
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
                if entry.name.isdigit() and "parsolid" in words and wanted in words:
                    found.append(int(entry.name))
        assert found, f"{name}: no ranks to kill"
        for process in found:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def same(self, name: str) -> None:
        """A finished run's folder holds the bits of the uninterrupted one."""
        assert summary(self.folder / name)["status"] == "finished"
        assert_same_bits(self.folder / name, self.whole)

    # --- cases ------------------------------------------------------------------------------------------------

    def warned_by_the_time_limit(self) -> None:
        """Slurm's own USR1 before the limit of one minute: put back, goes on."""
        job = self.submit("limit", "--time=1", "--signal=B:USR1@30")
        self.again(job, 1)
        self.slurm("scontrol", "update", f"JobId={job}", "TimeLimit=30")
        self.ends(job)
        assert "back into the queue" in (self.folder / "limit.log").read_text()
        self.same("limit")

    def warned_by_hand_three_times(self) -> None:
        """scancel --signal=USR1 --batch."""
        job = self.submit("warned")
        for turn in range(3):
            self.runs(job, "warned")
            self.slurm("scancel", "--signal=USR1", "--batch", job)
            self.again(job, turn + 1)
        self.ends(job)
        self.same("warned")

    def put_back_by_the_administrator(self) -> None:
        """scontrol requeue: the script is sent SIGTERM."""
        job = self.submit("requeued")
        self.runs(job, "requeued")
        self.slurm("scontrol", "requeue", job)
        self.again(job, 1)
        self.ends(job)
        self.same("requeued")

    def cancelled_and_submitted_again(self) -> None:
        """scancel: SIGTERM, a checkpoint; the same command goes on."""
        job = self.submit("cancelled")
        self.runs(job, "cancelled")
        self.slurm("scancel", job)
        self.ends(job, "CANCELLED")
        self.ends(self.submit("cancelled"))
        self.same("cancelled")

    def ranks_killed_and_submitted_again(self) -> None:
        """SIGKILL to the ranks: the job has failed; the same command goes on from the last checkpoint."""
        job = self.submit("killed")
        self.runs(job, "killed", 12)
        self.kill("killed")
        self.ends(job, "FAILED")
        self.ends(self.submit("killed"))
        self.same("killed")

    def the_node_fails(self) -> None:
        """The job's shell and ranks are gone at once, and Slurm puts the job back."""
        job = self.submit("node")
        self.runs(job, "node", 12)
        for process in self.slurm("pgrep", "-f", f"slurmstepd: \\[{job}").split():
            os.kill(int(process), signal.SIGKILL)
        self.kill("node")
        self.slurm("scontrol", "update", f"NodeName={self.show(job, 'BatchHost')}", "State=DOWN", "Reason=rehearsal")
        self.slurm("scontrol", "update", f"NodeName={self.show(job, 'BatchHost')}", "State=RESUME")
        self.again(job, 1)
        self.ends(job)
        self.same("node")

    def started_by_srun(self) -> None:
        """Slurm starts the ranks of MPICH itself; warned once."""
        self._by_srun("srun", {"PARSOLID_LAUNCH": "srun --mpi=pmi2"})

    def started_by_srun_with_pmix(self) -> None:
        """Slurm starts the ranks of Debian's Open MPI; the other MPI of the environment is left aside."""
        self._by_srun("pmix", {"PARSOLID_LAUNCH": "srun --mpi=pmix --cpu-bind=cores", "MPI4PY_MPIABI": "openmpi"})

    def _by_srun(self, name: str, variables: dict[str, str]) -> None:
        before, self.values = self.values, self.values | variables
        try:
            job = self.submit(name)
            self.runs(job, name)
            self.slurm("scancel", "--signal=USR1", "--batch", job)
            self.again(job, 1)
            self.ends(job)
            self.same(name)
        finally:
            self.values = before

    def an_array(self) -> None:
        """Two cases of a study, each in a folder of its own."""
        (self.folder / "cases.txt").write_text("--set method.cfl=0.5\n--set method.cfl=0.7\n")
        options = (f"--export=ALL,PARSOLID_SCRIPTS={ROOT / 'slurm'}", "--array=1-2")
        job = self.submit("array", *options, script="study.sbatch")
        done = [self.folder / "array" / number / "summary.json" for number in "12"]
        self.until(lambda: all(path.exists() for path in done), "both cases end")
        self.until(lambda: not self.slurm("squeue", "--noheader", f"--jobs={job}").strip(), "the array ends")
        assert [summary(path.parent)["status"] for path in done] == ["finished", "finished"]

    def a_refused_scene(self) -> None:
        """Status 2, not put back."""
        job = self.submit("refused", scene=write(changed(PUNCH, {"method.cfl": -1.0}), self.folder / "wrong.toml"))
        self.ends(job, "FAILED")
        assert self.show(job, "ExitCode") == "2:0" and self.show(job, "Restarts") == "0"
        assert "method.cfl: expected" in (self.folder / "refused.log").read_text()


CASES = (
    Rehearsal.a_refused_scene,
    Rehearsal.warned_by_hand_three_times,
    Rehearsal.started_by_srun,
    Rehearsal.started_by_srun_with_pmix,
    Rehearsal.put_back_by_the_administrator,
    Rehearsal.cancelled_and_submitted_again,
    Rehearsal.ranks_killed_and_submitted_again,
    Rehearsal.the_node_fails,
    Rehearsal.an_array,
    Rehearsal.warned_by_the_time_limit,
)


def main() -> int:
    """Rehearse all cases, or those whose names hold a word."""
    parser = argparse.ArgumentParser(prog="python -m checks.slurm_rehearsal", description=__doc__)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--end-time", type=float, default=0.3, help="of the scene [s]")
    options = parser.parse_args()
    missing = [name for name in ("slurmctld", "slurmd", "munged", "sbatch") if not shutil.which(name)]
    if missing or os.geteuid() != 0:
        print(f"expected root and the programs of Slurm, found no {', '.join(missing) or 'root'}", file=sys.stderr)
        return 2
    failed = 0
    with tempfile.TemporaryDirectory() as name, cluster(Path(name)) as values:
        rehearsal = Rehearsal(Path(name), values, options.end_time)
        for case in CASES:
            title = case.__name__.replace("_", " ")
            if options.words and not any(word in title for word in options.words):
                continue
            began, word = time.monotonic(), "as uninterrupted"
            try:
                case(rehearsal)
            except (AssertionError, TypeError, OSError, subprocess.CalledProcessError) as error:
                failed, word = failed + 1, f"FAILED {type(error).__name__}: {str(error)[:500]}"
            print(f"{title}: {word} ({time.monotonic() - began:.0f} s)", flush=True)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
