"""Runs of `parsolid` in subprocesses, several at once, with a time limit; each leaves a record.json in its folder."""

import os
import shlex
import shutil
import signal
import subprocess
import time as clock
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from parsolid.campaign.measures import not_finite
from parsolid.campaign.records import (
    CRASHED,
    FINAL_STATUSES,
    REFUSED,
    TIMED_OUT,
    Record,
    read_files,
    read_record,
    step_seconds,
    write_record,
)
from parsolid.exit_status import BAD_INPUT, DONE, WENT_WRONG
from parsolid.launcher import start
from parsolid.simulation.job import FAILED
from parsolid.simulation.loop import FINISHED

_STATUS_OF_EXIT = {DONE: FINISHED, WENT_WRONG: FAILED, BAD_INPUT: REFUSED}
# number of error messages that a run with a status prints
_EXPECTED_MESSAGES = {FINISHED: 0, FAILED: 1, REFUSED: 1}
# seconds between SIGTERM and SIGKILL: after a time limit, and when the study itself is interrupted
_GRACE, _SHORT_GRACE = 10.0, 1.0


@dataclass
class SubprocessRun:
    """A run of `parsolid` in a subprocess on some ranks with a time limit [s].

    arguments: folder of the run -> arguments of `parsolid`.
    """

    title: str
    arguments: Callable[[Path], list[str]]
    ranks: int
    timeout: float

    def run(self, folder: Path, repetitions: int = 1, on_start: Callable[[Any], None] = lambda process: None) -> Record:
        """Make the repetitions that a folder lacks; the record, also written into record.json.

        on_start: called with each process as it starts. A KeyboardInterrupt ends the process and leaves no record.
        """
        record = read_record(folder)
        if record is None or record.status not in FINAL_STATUSES:
            record = self._run_once(folder, on_start)
            write_record(folder, record)
        # in a folder of its own, so that an interruption keeps the first run
        folder_of_repetition = folder / "again"
        while record.status == FINISHED and len(record.loop_seconds) < repetitions:
            repetition = self._run_once(folder_of_repetition, on_start)
            shutil.rmtree(folder_of_repetition)
            if repetition.status != FINISHED:
                break
            record.loop_seconds += repetition.loop_seconds
            record.processor_seconds += repetition.processor_seconds
            record.ending["load"] += repetition.ending["load"]
            write_record(folder, record)
        return record

    def _run_once(self, folder: Path, on_start: Callable[[Any], None]) -> Record:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        load, start_time, arguments = os.getloadavg()[0], clock.perf_counter(), self.arguments(folder)
        with open(folder / "log.txt", "wb") as log:
            pipes = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": subprocess.STDOUT}
            process = start([*arguments, "--quiet", "--set", "output.pictures=false"], self.ranks, **pipes)
            on_start(process)
            exit_status = wait(process, self.timeout)
        status = TIMED_OUT if exit_status is None else _STATUS_OF_EXIT.get(exit_status, CRASHED)
        text = (folder / "log.txt").read_text(encoding="utf-8", errors="replace")
        summary, history = read_files(folder)
        record = Record(status, history, summary)
        if status == TIMED_OUT:
            record.message = f"ended after {self.timeout:g} s"
        elif status != FINISHED:
            # the error message, or the last lines if there is none
            _, found, message = text.partition("parsolid: ")
            record.message = (message if found else "\n".join(text.splitlines()[-3:])).strip()[:2000]
        if summary:
            wall, processor = step_seconds(summary)
            record.loop_seconds, record.processor_seconds = [wall], [processor]
        record.ending = {
            "title": self.title,
            "exit_status": exit_status,
            "clean": text.count("parsolid: ") == _EXPECTED_MESSAGES.get(status) and "Traceback" not in text,
            "not_finite": not_finite(folder),
            "seconds": clock.perf_counter() - start_time,
            "load": [load],
            "ranks": self.ranks,
            "command": shlex.join(["parsolid", *arguments]),
        }
        return record


def run_concurrently(
    runs: Sequence[tuple[SubprocessRun, Path]], jobs: int, repetitions: int
) -> Generator[tuple[int, Record, float], None, None]:
    """Make runs in their folders, `jobs` at once; yields index, record and wall seconds of each run as it ends.

    Closing the generator, or an exception in its user, ends the runs under way, which leave no record.
    """
    processes, unfinished = list[subprocess.Popen[Any]](), set(range(len(runs)))

    def make(index: int) -> tuple[int, Record, float]:
        run, folder = runs[index]
        start_time = clock.perf_counter()
        return index, run.run(folder, repetitions, processes.append), clock.perf_counter() - start_time

    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(make, index) for index in range(len(runs))]
        try:
            for future in as_completed(futures):
                unfinished.discard(future.result()[0])
                yield future.result()
        finally:
            for future in futures:
                future.cancel()
            while unfinished and not all(future.done() for future in futures):
                for process in list(processes):
                    _end(process, _SHORT_GRACE)
                clock.sleep(0.01)
            for index in unfinished:
                record = read_record(runs[index][1])
                if record is not None and record.status not in FINAL_STATUSES:
                    with suppress(OSError):
                        (runs[index][1] / "record.json").unlink()


def wait(process: subprocess.Popen[Any], timeout: float) -> int | None:
    """The exit status of a run, None if the time limit [s] ended it; its whole process group has ended on return."""
    try:
        return process.wait(timeout)
    except subprocess.TimeoutExpired:
        return None
    except KeyboardInterrupt:
        _end(process, _SHORT_GRACE)
        raise
    finally:
        _end(process, _GRACE)


def _end(process: subprocess.Popen[Any], grace: float) -> None:
    """End the process group of a run: SIGTERM, then SIGKILL after a grace period [s]."""
    for number, patience in ((signal.SIGTERM, grace), (signal.SIGKILL, None)):
        if process.poll() is None:
            try:
                os.killpg(process.pid, number)
                process.wait(patience)
            except (ProcessLookupError, subprocess.TimeoutExpired):
                continue
