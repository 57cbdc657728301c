"""python -m checks.soak --kills 1000 --hours 2: end runs in every way at random instants, and go on.

A random scene on random ranks writes checkpoints often; its job is killed, or one rank of it, or asked to stop by
SIGTERM, SIGINT or the clock, again and again, and continued on the same ranks or on others. What it leaves at its end
has to be what the uninterrupted run leaves: on the same ranks to the last bit, on others to 1e-9. Prints one line a
run and a table at the end; status 1 when anything was lost, a job hung, or a traceback was seen.
"""

import argparse
import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "end_to_end"))

from cases import CASES
from command_line import finish, kill, ranks_of, start
from run_results import assert_close, assert_same_bits
from small_scenes import changed, write

# checkpoints at every second step, so that many ends fall into the writing of one
OUTPUT = {"output.checkpoint_steps": 2, "output.history_steps": 1, "output.pictures": False}
SCENES = {
    name: changed(case.make(Path()), OUTPUT)
    for name, case in CASES.items()
    if case.steps is None and "mesh" not in case.tags
}
MOST_RANKS, MOST_ENDS = 3, 10
WAYS = ("kill all", "kill one rank", "SIGTERM", "SIGINT", "wall time", "kill mpirun")
# a job that lasts longer has hung [s]
PATIENCE = 300.0


class Soak:
    """Runs, kills and compares in a folder."""

    def __init__(self, folder: Path, chance: random.Random):
        self.folder, self.chance = folder, chance
        self.whole: dict[tuple[str, int], tuple[Path, float]] = {}
        self.ended: Counter[str] = Counter()
        self.within: Counter[str] = Counter()
        self.runs, self.faults = 0, []
        for name, scene in SCENES.items():
            write(scene, folder / f"{name}.toml")

    def uninterrupted(self, name: str, ranks: int) -> tuple[Path, float]:
        """The folder of a whole run and the seconds that it takes, run when it is first asked for."""
        if (name, ranks) not in self.whole:
            output = self.folder / f"{name}-{ranks}"
            words = [self.folder / f"{name}.toml", "-q", "-o", output]
            result = finish(start(words, ranks), PATIENCE)
            assert result.status == 0, result.err
            self.whole[name, ranks] = output, result.seconds
        return self.whole[name, ranks]

    def run(self, kills: int) -> None:
        """One run with at most so many ends before its own."""
        self.runs += 1
        name, ranks = self.chance.choice(sorted(SCENES)), self.chance.randint(1, MOST_RANKS)
        expected, seconds = self.uninterrupted(name, ranks)
        output, same, ways = self.folder / f"run-{self.runs}", True, []
        for turn in range(kills + 1):
            more = ["--restart"] if (output / "checkpoint.h5").exists() else []
            way = self.chance.choice(WAYS) if turn < kills else "none"
            now = ranks if not more or self.chance.random() < 0.7 else self.chance.randint(1, MOST_RANKS)
            same = same and now == ranks
            if self._once([self.folder / f"{name}.toml", "-q", "-o", output, *more], now, way, seconds, ways):
                break
        try:
            (assert_same_bits if same else lambda a, b: assert_close(a, b, 1e-9))(output, expected)
            word = "the same bits" if same else "the same numbers"
        except (AssertionError, Exception) as error:
            word = f"FAULT {type(error).__name__}: {str(error)[:300]}"
            self.faults.append((self.runs, name, word))
        done = f"{self.ended.total()} ends, {len(self.faults)} faults"
        print(
            f"run {self.runs}: {name} on {ranks} ranks, {', '.join(ways) or 'not ended'}: {word} ({done})", flush=True
        )
        if not word.startswith("FAULT"):
            shutil.rmtree(output)

    def _once(self, command: list, ranks: int, way: str, seconds: float, ways: list[str]) -> bool:
        """Start a job and end it in a way at a random instant; whether it came to its own end before."""
        history, limit = Path(command[3]) / "history.csv", self.chance.uniform(0.0, 0.7) * seconds
        clocked = ["--wall-time", f"{max(0.1, limit):.3f}"] if way == "wall time" else []
        job = start([*command, *clocked], ranks)
        if way not in ("none", "wall time"):
            self._wait(job, history, limit)
            if job.poll() is None:
                _end(job, way, self.chance)
        began = _rows(history)
        result = finish(job, PATIENCE)
        # a signal before Python has loaded the program ends it as any process, or within Python's own imports
        loading = "KeyboardInterrupt" in result.err and "parsolid/" not in result.err
        plain = way.startswith("SIG") and result.status == getattr(signal, way, None) and (loading or not result.err)
        if ("Traceback" in result.err and not plain) or (history.parent / "traceback.txt").exists():
            self.faults.append((self.runs, way, result.err[-500:]))
        if result.status in (1, 2, 3) and way not in ("kill one rank", "kill mpirun") and not plain:
            self.faults.append((self.runs, way, f"status {result.status}: {result.err[-300:]}"))
        if result.status != 0:
            self.ended[way] += 1
            self.within["steps" if began else "set-up"] += 1
            ways.append(f"{way} ({result.status}) at {began} of history")
        return result.status == 0

    def _wait(self, job: subprocess.Popen, history: Path, limit: float) -> None:
        """Until a random row of the history that this job adds, or in one of four cases for a random time."""
        rows, began = _rows(history), time.monotonic()
        wanted = self.chance.randint(1, 6)
        soon = self.chance.random() < 0.25
        while job.poll() is None and time.monotonic() < began + (limit if soon else PATIENCE):
            if not soon and _rows(history) >= rows + wanted:
                time.sleep(self.chance.uniform(0.0, 0.05))
                return
            time.sleep(0.002)


def _rows(history: Path) -> int:
    # a run that begins anew moves the file of the one before
    with contextlib.suppress(FileNotFoundError):
        return history.read_bytes().count(b"\n")
    return 0


def _end(job, way: str, chance: random.Random) -> None:
    processes = ranks_of(job)
    if way == "kill all":
        kill(job)
    elif way == "kill mpirun":
        job.kill()
    elif processes:
        number = {"kill one rank": signal.SIGKILL}.get(way) or getattr(signal, way)
        # it may have ended meanwhile
        with contextlib.suppress(ProcessLookupError):
            os.kill(chance.choice(processes), number)


def main() -> int:
    """Soak until so many kills are done or the time is over."""
    parser = argparse.ArgumentParser(prog="python -m checks.soak", description=__doc__)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--hours", type=float, default=2.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    end = time.monotonic() + 3600.0 * options.hours
    with tempfile.TemporaryDirectory() as folder:
        soak = Soak(Path(folder), random.Random(options.seed))
        while soak.ended.total() < options.kills and time.monotonic() < end:
            soak.run(min(MOST_ENDS, options.kills - soak.ended.total()))
    print(f"\n{dict(soak.within)}\n\n| way | ended |\n|---|---|")
    for way, count in sorted(soak.ended.items()):
        print(f"| {way} | {count} |")
    print(f"\n{soak.ended.total()} ends in {soak.runs} runs (seed {options.seed}), {len(soak.faults)} faults")
    for fault in soak.faults:
        print(fault)
    return int(bool(soak.faults))


if __name__ == "__main__":
    sys.exit(main())
