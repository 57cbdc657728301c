"""Records of runs: the status, history, summary and times of a run, read from its folder; record.json of a study."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.output.errors import OutputError
from parsolid.output.history import read_history
from parsolid.output.summary import read_summary, write_summary
from parsolid.simulation.job import FAILED
from parsolid.simulation.loop import FINISHED

History = dict[str, np.ndarray]
REFUSED, TIMED_OUT, CRASHED = "refused", "timed out", "crashed"
# repeating a run with one of these statuses gives the same status
FINAL_STATUSES = (FINISHED, FAILED, REFUSED)
# entries of record.json that are attributes of a Record; all others are its `ending`
_ATTRIBUTES = ("status", "message", "loop_seconds", "processor_seconds")


@dataclass
class Record:
    """Result of a run.

    history: column -> values (n,), on rank 0 only; loop_seconds, processor_seconds: wall and processor time [s] of the
    time loop, one entry per repetition (see `step_seconds`); message: the error message of a run that did not finish;
    ending: of a run in a subprocess, the other entries of record.json (exit status, command, load average).
    """

    status: str
    history: History = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)
    loop_seconds: list[float] = field(default_factory=list)
    processor_seconds: list[float] = field(default_factory=list)
    message: str | None = None
    ending: dict[str, Any] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """Processor time [s] of all ranks in the fastest repetition."""
        return min(self.processor_seconds, default=0.0)

    @property
    def core_seconds(self) -> float:
        """Wall time [s] times the number of ranks of the fastest repetition."""
        return float(self.summary.get("ranks", 1)) * min(self.loop_seconds, default=0.0)

    @property
    def particles(self) -> int:
        """Number of particles of all bodies; 0 without a summary."""
        return int(self.summary.get("particles", 0))

    @property
    def steps(self) -> int:
        """Number of time steps; 0 without a summary."""
        return int(self.summary.get("steps", 0))


def read_files(folder: Path) -> tuple[dict[str, Any], History]:
    """Read summary.json and history.csv of a run; a missing file gives an empty dictionary. Raises OutputError."""
    summary, history = {}, {}
    if (folder / "summary.json").exists():
        summary = read_summary(folder / "summary.json")
    if (folder / "history.csv").exists():
        history = {name: np.array(values) for name, values in read_history(folder / "history.csv").items()}
    return summary, history


def step_seconds(summary: dict[str, Any]) -> tuple[float, float]:
    """Wall and processor time [s] of all steps of a run, with the first step replaced by the mean of the others.

    The first step loads the compiled kernels. In quasi-static runs it may need most of the iterations, and is kept.
    """
    steps = summary["steps"]
    wall, processor = float(summary["loop_seconds"]), float(summary["loop_processor_seconds"])
    if steps > 1 and not summary.get("iterations"):
        first_wall, first_processor = summary["first_step_seconds"], summary["first_step_processor_seconds"]
        if first_wall < wall:
            wall = float((wall - first_wall) * steps / (steps - 1))
        if first_processor < processor:
            processor = float((processor - first_processor) * steps / (steps - 1))
    return wall, processor


def read_record(folder: Path) -> Record | None:
    """Read record.json, summary.json and history.csv of a run; None if one of them cannot be read."""
    try:
        entries = json.loads((folder / "record.json").read_text(encoding="utf-8"))
        summary, history = read_files(folder)
    except (OSError, ValueError, OutputError):
        return None
    attributes = {name: entries.pop(name) for name in _ATTRIBUTES}
    return Record(history=history, summary=summary, **attributes, ending=entries)


def write_record(folder: Path, record: Record) -> None:
    """Write record.json."""
    attributes = {name: getattr(record, name) for name in _ATTRIBUTES}
    write_summary(folder / "record.json", attributes | record.ending)
