"""Starts one run as a program of its own, waits for it within a time limit, and says how it ended."""

import json
import os
import shlex
import shutil
import signal
import subprocess
import time as clock
from pathlib import Path
from typing import Any

from parsolid.commands.study.cases import Case
from parsolid.commands.study.measures import not_finite
from parsolid.launcher import start
from parsolid.output.summary import write_summary

FINISHED, FAILED, REFUSED, TIMED_OUT, CRASHED = "finished", "failed", "refused", "timed out", "crashed"
# what these said once they will say again
LASTING = (FINISHED, FAILED, REFUSED)
_ENDINGS = {0: FINISHED, 3: FAILED, 2: REFUSED}
# seconds between the signal that a run catches and the one that it cannot; where the study itself is ended, whose
# unfinished runs are begun anew, no more than a launcher takes to end its ranks
_GRACE, _HASTE = 10.0, 1.0


def arguments_of(case: Case, folder: Path) -> list[str]:
    """The arguments of `parsolid` that make a run."""
    overrides = [word for override in case.overrides for word in ("--set", override)]
    scene = min(case.series.scene, os.path.relpath(case.series.scene), key=len)
    trust = ["--trust-code"] if case.trust_code else []
    return ["run", scene, "-o", str(folder), *overrides, *trust]


def run_case(case: Case, folder: Path, repetitions: int = 1) -> dict[str, Any]:
    """Make a run as many times as it lacks repetitions, and return its record, which is kept in the folder.

    Record: status, exit_status, message (last words of a run that did not finish), clean (one message at most),
    not_finite (files that hold such numbers), seconds (wall, of the first), loop_seconds, processor_seconds and load
    (load average of the machine at the start) of each, command. A KeyboardInterrupt ends the run and leaves no record
    that it is done.
    """
    record = read_record(folder)
    if record.get("status") not in LASTING:
        record = _run_once(case, folder)
        write_summary(folder / "record.json", record)
    # made beside, so that an interruption takes nothing of what is there
    beside = folder / "again"
    while record["status"] == FINISHED and len(record["loop_seconds"]) < repetitions:
        again = _run_once(case, beside)
        shutil.rmtree(beside)
        if again["status"] != FINISHED:
            break
        record |= {key: record[key] + again[key] for key in ("loop_seconds", "processor_seconds", "load")}
        write_summary(folder / "record.json", record)
    return record


def read_record(folder: Path) -> dict[str, Any]:
    """The record of a run, empty when there is none that can be read."""
    try:
        return json.loads((folder / "record.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def _run_once(case: Case, folder: Path) -> dict[str, Any]:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    load = os.getloadavg()[0]
    arguments = arguments_of(case, folder)
    began = clock.perf_counter()
    with open(folder / "log.txt", "wb") as log:
        pipes = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": subprocess.STDOUT}
        process = start([*arguments, "--quiet", "--set", "output.pictures=false"], case.ranks, **pipes)
        exit_status = _wait(process, case.timeout)
    status = TIMED_OUT if exit_status is None else _ENDINGS.get(exit_status, CRASHED)
    log_text = (folder / "log.txt").read_text(encoding="utf-8", errors="replace")
    return {
        "title": case.title,
        "status": status,
        "exit_status": exit_status,
        "message": None if status == FINISHED else _last_words(log_text, status, case.timeout),
        "clean": _clean(log_text, status),
        "not_finite": not_finite(folder),
        "seconds": clock.perf_counter() - began,
        **_seconds(folder),
        "load": [load],
        "ranks": case.ranks,
        "command": shlex.join(["parsolid", *arguments]),
    }


def _wait(process: subprocess.Popen[Any], timeout: float) -> int | None:
    """Exit status, None when the time limit [s] ended the run; no process of it outlives the call."""
    try:
        return process.wait(timeout)
    except subprocess.TimeoutExpired:
        return None
    except KeyboardInterrupt:
        _end(process, _HASTE)
        raise
    finally:
        _end(process, _GRACE)


def _end(process: subprocess.Popen[Any], grace: float) -> None:
    """End what is left of a run: with the signal that it catches, and after a grace [s] for certain."""
    for number, patience in ((signal.SIGTERM, grace), (signal.SIGKILL, None)):
        if process.poll() is None:
            try:
                os.killpg(process.pid, number)
                process.wait(patience)
            except (ProcessLookupError, subprocess.TimeoutExpired):
                continue


def _last_words(log: str, status: str, timeout: float) -> str:
    """What the run said of its end."""
    if status == TIMED_OUT:
        return f"ended after {timeout:g} s"
    found = log.find("parsolid: ")
    text = log[found + len("parsolid: ") :] if found >= 0 else "\n".join(log.splitlines()[-3:])
    return text.strip()[:2000]


def _clean(log: str, status: str) -> bool:
    """Whether the run ended as it should: silently, or with one message and no traceback."""
    wanted = {FINISHED: 0, FAILED: 1, REFUSED: 1}.get(status)
    return log.count("parsolid: ") == wanted and "Traceback" not in log


def _seconds(folder: Path) -> dict[str, list[float]]:
    """loop_seconds and processor_seconds (of all ranks) of the time loop; nothing where there is no summary.

    The first step, which also loads or compiles the kernels, counts as one of the others.
    """
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {"loop_seconds": [], "processor_seconds": []}
    steps, result = summary["steps"], {}
    for name, loop, first in (
        ("loop_seconds", "loop_seconds", "first_step_seconds"),
        ("processor_seconds", "loop_processor_seconds", "first_step_processor_seconds"),
    ):
        result[name] = [(summary[loop] - summary[first]) * steps / (steps - 1) if steps > 1 else summary[loop]]
    return result
