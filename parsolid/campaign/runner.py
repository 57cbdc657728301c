"""Runs scenes and keeps what they left, and measures of it: on the ranks of this process, or as programs of their own.

A run's folder is named by a digest of all that its numbers depend on, so that what has been run is not run again, and
what was stopped or killed goes on.
"""

import gc
import json
import os
import shlex
import shutil
import signal
import subprocess
import time as clock
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from mpi4py import MPI

from parsolid.campaign.variants import Variant
from parsolid.collective import SolverError, anywhere
from parsolid.exit_status import BAD_INPUT, DONE, WENT_WRONG
from parsolid.launcher import start
from parsolid.output.checkpoint import DEFAULT_NAME, find_checkpoint, partial_name, previous_name
from parsolid.output.errors import OutputError, together
from parsolid.output.history import read_history
from parsolid.output.run_folder import RunFolder
from parsolid.output.summary import read_summary, write_summary
from parsolid.scene import Scene, SceneError
from parsolid.scene.observation import stored_energy
from parsolid.simulation.job import FAILED, Job
from parsolid.simulation.loop import FINISHED, Limits, RunFailed, Simulation
from parsolid.simulation.restart import Restart
from parsolid.simulation.signals import REQUEST

History = dict[str, np.ndarray]
REFUSED, TIMED_OUT, CRASHED = "refused", "timed out", "crashed"
# a run that ended so ends so again
LASTING = (FINISHED, FAILED, REFUSED)
_MESSAGES = {FINISHED: 0, FAILED: 1, REFUSED: 1}
_ENDINGS = {DONE: FINISHED, WENT_WRONG: FAILED, BAD_INPUT: REFUSED}
# seconds between the signal that a run catches and the one that it cannot; where the study itself is ended, whose
# unfinished runs are begun anew, no more than a launcher takes to end its ranks
_GRACE, _HASTE = 10.0, 1.0


class Interrupted(Exception):
    """A signal or the wall time ended a run, which left a checkpoint."""


@dataclass
class Record:
    """What a run left.

    history: column -> values, on rank 0 alone; loop_seconds, processor_seconds: of each repetition, the first step,
    which loads kernels, counted as one of the others; message: last words of a run that did not finish; ending: of a
    program of its own, as record.json has it.
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
        """Processor seconds of all ranks, of the fastest repetition."""
        return min(self.processor_seconds, default=0.0)

    @property
    def core_seconds(self) -> float:
        """Wall seconds times ranks, of the fastest repetition."""
        return float(self.summary.get("ranks", 1)) * min(self.loop_seconds, default=0.0)

    @property
    def particles(self) -> int:
        """Particles of all bodies; 0 where the run has not begun."""
        return int(self.summary.get("particles", 0))

    @property
    def steps(self) -> int:
        """Steps taken."""
        return int(self.summary.get("steps", 0))


@dataclass(frozen=True)
class VariantRun:
    """A variant that has been run."""

    variant: Variant
    record: Record

    @property
    def ratio(self) -> float:
        """Spacing over that of the run beside which it was made."""
        return self.variant.ratio

    @property
    def history(self) -> History:
        """On rank 0; empty where the run did not finish."""
        return self.record.history if self.record.status == FINISHED else {}

    @property
    def seconds(self) -> float:
        """Processor seconds."""
        return self.record.seconds

    def over(self, ratio: float) -> "VariantRun":
        """The same with its ratio over that of a level."""
        return VariantRun(replace(self.variant, ratio=self.variant.ratio / ratio), self.record)


def read_files(folder: Path) -> tuple[dict[str, Any], History]:
    """Summary and history of a folder, empty where there are none; for one rank. Raises OutputError."""
    summary, history = folder / "summary.json", folder / "history.csv"
    return (
        read_summary(summary) if summary.exists() else {},
        {name: np.array(values) for name, values in read_history(history).items()} if history.exists() else {},
    )


def seconds_of(summary: dict[str, Any]) -> tuple[float, float]:
    """Wall and processor seconds of a run's steps; the first, which loads kernels, counts as one of the others.

    Not of quasi-static solutions, where the first step may have most of the iterations.
    """
    steps, result = summary["steps"], []
    alike = steps > 1 and not summary.get("iterations")
    for loop, first in (
        (summary["loop_seconds"], summary["first_step_seconds"]),
        (summary["loop_processor_seconds"], summary["first_step_processor_seconds"]),
    ):
        result.append(float((loop - first) * steps / (steps - 1) if alike and first < loop else loop))
    return result[0], result[1]


class InProcess:
    """Runs variants on the ranks of this process, each into a folder below one; all methods are collective."""

    def __init__(self, comm: MPI.Intracomm, folder: Path, limits: Limits | None = None) -> None:
        self.comm, self.folder, self.limits = comm, folder, limits or Limits()

    def run(self, variant: Variant, folder: Path | None = None, begins: Callable[[], None] | None = None) -> VariantRun:
        """Run a variant unless it is there; begins: called where it is not. Raises Interrupted on all ranks.

        A scene that cannot be set up is a record with that message: the run itself tells whether it can be.
        """
        place = folder or self.folder / self.comm.bcast(variant.digest if self.comm.rank == 0 else None)
        record = self.read(place)
        if record is None:
            if begins is not None:
                begins()
            try:
                run_into(self.comm, variant.scene, place, self.limits)
            except (SceneError, SolverError) as error:
                return VariantRun(variant, Record(REFUSED, message=f"it cannot be set up: {error}"))
            record = self.read(place)
            assert record is not None
        return VariantRun(variant, record)

    def read(self, folder: Path) -> Record | None:
        """What a run that has ended left in a folder, None where it has not; the history on rank 0."""
        record = None
        with together(self.comm, f"cannot read {folder}"):
            if self.comm.rank == 0 and (folder / "summary.json").exists():
                summary, history = read_files(folder)
                if summary["status"] in (FINISHED, FAILED):
                    wall, processor = seconds_of(summary)
                    record = Record(summary["status"], history, summary, [wall], [processor], summary.get("fault"))
        known: Record | None = self.comm.bcast(None if record is None else replace(record, history={}))
        return record if self.comm.rank == 0 else known


def has_checkpoint(comm: MPI.Intracomm, folder: Path) -> bool:
    """Whether a run in a folder has left a checkpoint. Collective."""
    name = folder / DEFAULT_NAME
    return anywhere(comm, any(path.exists() for path in (name, partial_name(name), previous_name(name))))


def run_into(comm: MPI.Intracomm, scene: Scene, folder: Path, limits: Limits) -> None:
    """Run a scene, or go on with it, into a folder. Raises Interrupted. Collective."""
    restart = None
    if has_checkpoint(comm, folder):
        try:
            restart = Restart(comm, find_checkpoint(folder, comm))
        except OutputError:
            # it begins anew
            restart = None
    # of the run before this one: systems have references to themselves, and are large
    gc.collect()
    simulation = Simulation(comm, scene, restart)
    with (
        closing(RunFolder(comm, folder, restart.path if restart else None)) as files,
        closing(Job(simulation, files, restart)) as job,
    ):
        try:
            status = job.run(limits, REQUEST)["status"]
        except RunFailed:
            status = FAILED
    if status not in (FINISHED, FAILED):
        raise Interrupted


@dataclass
class Launched:
    """Runs `parsolid` with arguments as a program of its own on ranks, and ends it after a time [s]."""

    title: str
    arguments: Callable[[Path], list[str]]
    ranks: int
    timeout: float

    def run(self, folder: Path, repetitions: int = 1, begun: Callable[[Any], None] = lambda job: None) -> Record:
        """Run as many times as a folder lacks repetitions, and return the record, which is kept in record.json.

        begun: is given each program as it begins. A KeyboardInterrupt ends the run and leaves no record that it is
        done.
        """
        record = read_record(folder)
        if record is None or record.status not in LASTING:
            record = self._once(folder, begun)
            write_record(folder, record)
        # made beside, so that an interruption takes nothing of what is there
        beside = folder / "again"
        while record.status == FINISHED and len(record.loop_seconds) < repetitions:
            again = self._once(beside, begun)
            shutil.rmtree(beside)
            if again.status != FINISHED:
                break
            record.loop_seconds += again.loop_seconds
            record.processor_seconds += again.processor_seconds
            record.ending["load"] += again.ending["load"]
            write_record(folder, record)
        return record

    def _once(self, folder: Path, begun: Callable[[Any], None]) -> Record:
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        load, began, arguments = os.getloadavg()[0], clock.perf_counter(), self.arguments(folder)
        with open(folder / "log.txt", "wb") as log:
            pipes = {"stdin": subprocess.DEVNULL, "stdout": log, "stderr": subprocess.STDOUT}
            job = start([*arguments, "--quiet", "--set", "output.pictures=false"], self.ranks, **pipes)
            begun(job)
            exit_status = wait(job, self.timeout)
        status = TIMED_OUT if exit_status is None else _ENDINGS.get(exit_status, CRASHED)
        text = (folder / "log.txt").read_text(encoding="utf-8", errors="replace")
        summary, history = read_files(folder)
        record = Record(status, history, summary)
        if status != FINISHED:
            # its last words where it has said why it ended
            found = text.find("parsolid: ")
            words = text[found + len("parsolid: ") :] if found >= 0 else "\n".join(text.splitlines()[-3:])
            record.message = f"ended after {self.timeout:g} s" if status == TIMED_OUT else words.strip()[:2000]
        if summary:
            wall, processor = seconds_of(summary)
            record.loop_seconds, record.processor_seconds = [wall], [processor]
        record.ending = {
            "title": self.title,
            "exit_status": exit_status,
            # silently, or with one message and no traceback
            "clean": text.count("parsolid: ") == _MESSAGES.get(status) and "Traceback" not in text,
            "not_finite": not_finite(folder),
            "seconds": clock.perf_counter() - began,
            "load": [load],
            "ranks": self.ranks,
            "command": shlex.join(["parsolid", *arguments]),
        }
        return record


def run_beside(
    runs: Sequence[tuple[Launched, Path]], jobs: int, repetitions: int
) -> Generator[tuple[int, Record, float], None, None]:
    """Make runs into their folders, so many at once; number, record and wall seconds of each as it ends.

    Whoever closes the iterator, or interrupts it, ends the runs that are under way, which leave no record.
    """
    programs, open_runs = list[subprocess.Popen[Any]](), set(range(len(runs)))

    def make(number: int) -> tuple[int, Record, float]:
        launched, folder = runs[number]
        began = clock.perf_counter()
        return number, launched.run(folder, repetitions, programs.append), clock.perf_counter() - began

    with ThreadPoolExecutor(jobs) as pool:
        made = [pool.submit(make, number) for number in range(len(runs))]
        try:
            for one in as_completed(made):
                open_runs.discard(one.result()[0])
                yield one.result()
        finally:
            for one in made:
                one.cancel()
            while open_runs and not all(one.done() for one in made):
                for program in list(programs):
                    _end(program, _HASTE)
                clock.sleep(0.01)
            for number in open_runs:
                record = read_record(runs[number][1])
                if record is not None and record.status not in LASTING:
                    with suppress(OSError):
                        (runs[number][1] / "record.json").unlink()


def read_record(folder: Path) -> Record | None:
    """The record of a program of its own; None where there is none that can be read."""
    try:
        kept = json.loads((folder / "record.json").read_text(encoding="utf-8"))
        summary, history = read_files(folder)
    except (OSError, ValueError, OutputError):
        return None
    known = {name: kept.pop(name) for name in ("status", "message", "loop_seconds", "processor_seconds")}
    return Record(history=history, summary=summary, **known, ending=kept)


def write_record(folder: Path, record: Record) -> None:
    """Keep a record in record.json."""
    kept = {name: getattr(record, name) for name in ("status", "message", "loop_seconds", "processor_seconds")}
    write_summary(folder / "record.json", kept | record.ending)


def wait(job: subprocess.Popen[Any], timeout: float) -> int | None:
    """Exit status, None when the time limit [s] ended the run; no process of it outlives the call."""
    try:
        return job.wait(timeout)
    except subprocess.TimeoutExpired:
        return None
    except KeyboardInterrupt:
        _end(job, _HASTE)
        raise
    finally:
        _end(job, _GRACE)


def _end(job: subprocess.Popen[Any], grace: float) -> None:
    """End what is left of a run: with the signal that it catches, and after a grace [s] for certain."""
    for number, patience in ((signal.SIGTERM, grace), (signal.SIGKILL, None)):
        if job.poll() is None:
            try:
                os.killpg(job.pid, number)
                job.wait(patience)
            except (ProcessLookupError, subprocess.TimeoutExpired):
                continue


def not_finite(folder: Path) -> list[str]:
    """Names of the files of a run, and where in them, that hold a number that is not finite.

    The tip of a crack is nan before there is a crack.
    """
    columns = {name: values for name, values in read_files(folder)[1].items() if ".crack_tip_" not in name}
    faults = [f"history.csv: {name}" for name, values in columns.items() if not np.isfinite(values).all()]
    for path in sorted(folder.glob("*.vtkhdf")) + sorted(folder.glob("checkpoint*.h5")):
        with h5py.File(path) as file:

            def look(name: Any, item: Any, path: Path = path) -> None:
                if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" and not np.isfinite(item[()]).all():
                    faults.append(f"{path.name}: {name}")

            file.visititems(look)
    return faults


# name -> (heading in a table, format, what it is)
MEASURES = {
    "particles": ("particles", ",d", "particles"),
    "steps": ("steps", ",d", "time steps"),
    "particle_steps": ("particle-steps", ".3g", "particles times steps"),
    "iterations_per_step": ("iterations a step", ".1f", "force evaluations of a quasi-static step, on average"),
    "core_seconds": ("core-s", ".3g", "seconds of the time loop times ranks, kernels being loaded, at the least"),
    "processor_seconds": ("CPU s", ".3g", "seconds of all ranks' processors in the time loop, at the least"),
    "wall_seconds": ("wall s", ".3g", "wall time of the run with set-up and output [s]"),
    "particle_steps_per_core_second": ("particle-steps / core-s", ".3g", "speed"),
    "mean_step": ("mean dt [s]", ".3g", "simulated time over steps [s]"),
    "smallest_step": ("least dt [s]", ".3g", "smallest step at a row of the history [s]"),
    "peak_memory_bytes_per_rank": ("MiB a rank", ".0f", "most memory a rank had [B]"),
    "energy_drift": ("energy drift", ".1e", "largest |energy error| over the largest energy"),
    "numerical_dissipation": ("D_num/E0", ".3g", "numerical dissipation at the end over the energy at the start"),
    "material_dissipation": ("D_int/E0", ".3g", "dissipation of the material at the end over the energy at the start"),
    "largest_fall": (
        "largest fall of D/E0",
        ".1e",
        "most that a dissipation fell between rows of the history, over E0",
    ),
    "momentum_drift": ("momentum drift", ".1e", "largest change of a probed linear momentum over its largest size"),
    "smallest_jacobian": ("least J", ".3g", "smallest Jacobian that a probe saw"),
}


# of the momentum that all mass has with its kinetic energy: what is less is none
_NONE = 1e-9


def measures_of(record: Record) -> dict[str, Any]:
    """Measures and errors (under "errors") of a run; empty where there is no summary. A failed run has those that its
    files give.
    """
    summary = record.summary
    if not summary or not record.loop_seconds:
        return {}
    steps, particles, core_seconds = record.steps, record.particles, record.core_seconds
    measures = {
        "particles": particles,
        "steps": steps,
        "particle_steps": particles * steps,
        "iterations_per_step": summary.get("iterations_per_step"),
        "core_seconds": core_seconds,
        "processor_seconds": record.seconds,
        "wall_seconds": summary["wall_seconds"],
        "particle_steps_per_core_second": particles * steps / core_seconds if core_seconds else None,
        "mean_step": summary["end_time"] / steps if steps else None,
        "peak_memory_bytes_per_rank": summary["peak_memory_bytes_per_rank"],
        "errors": summary["errors"],
    }
    return measures | energies_of(record.history) | momentum_of(record.history, summary.get("mass"))


def energies_of(history: dict[str, np.ndarray]) -> dict[str, Any]:
    """What the ledger's columns (rows,) [J] say: drift, dissipations over the energy at the start, and their falls."""
    if not len(history.get("time", ())):
        return {}
    energy = np.abs([history[name] for name in ("kinetic", stored_energy(history), "external_work")])
    largest, start = energy.max(), energy[:, 0].sum()
    # a body at rest at the start has the largest energy for a scale
    scale = start or largest
    falls = [np.max(-np.diff(history[name]), initial=0.0) for name in ("material_dissipation", "numerical_dissipation")]
    steps = history["dt"][history["step"] > 0]
    result = {
        "smallest_step": float(steps.min()) if len(steps) else None,
        "energy_drift": _over(np.abs(history["energy_error"]).max(), largest),
        "numerical_dissipation": _over(history["numerical_dissipation"][-1], scale),
        "material_dissipation": _over(history["material_dissipation"][-1], scale),
        "largest_fall": _over(max(falls), scale),
    }
    jacobians = [values.min() for name, values in history.items() if name.endswith(".minimum_jacobian")]
    return result | ({"smallest_jacobian": float(min(jacobians))} if jacobians else {})


def momentum_of(history: dict[str, np.ndarray], mass: float | None = None) -> dict[str, Any]:
    """Drift of the probed linear momentum; empty without such a probe.

    Over its largest size or, where momentum is zero but for rounding, over that of the mass [kg] with the largest
    kinetic energy.
    """
    names = [name for name in history if ".linear_momentum_" in name]
    if not names or not len(history.get("time", ())):
        return {}
    momentum = np.stack([history[name] for name in names], axis=1)
    drift = np.abs(momentum - momentum[0]).max()
    largest = float(np.abs(momentum).max())
    possible = float(np.sqrt(2.0 * max(mass or 0.0, 0.0) * history["kinetic"].max())) if "kinetic" in history else 0.0
    return {"momentum_drift": _over(drift, largest if largest > _NONE * possible else possible)}


def _over(value: float, scale: float) -> float | None:
    return float(value / scale) if scale > 0.0 else None
