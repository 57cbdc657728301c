"""Runs of variants on the ranks of this process. A run is kept in a folder named by its digest, and is not repeated."""

import gc
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from mpi4py import MPI

from parsolid.campaign.records import REFUSED, History, Record, read_files, step_seconds
from parsolid.campaign.variants import Variant
from parsolid.collective import SolverError, anywhere
from parsolid.output.checkpoint import DEFAULT_NAME, find_checkpoint, partial_name, previous_name
from parsolid.output.errors import OutputError, together
from parsolid.output.run_folder import RunFolder
from parsolid.scene import Scene, SceneError
from parsolid.simulation.job import FAILED, Job
from parsolid.simulation.loop import FINISHED, Limits, RunFailed, Simulation
from parsolid.simulation.restart import Restart
from parsolid.simulation.signals import REQUEST


class Interrupted(Exception):
    """A signal or the wall time ended a run, which left a checkpoint."""


@dataclass(frozen=True)
class VariantRun:
    """A variant and the record of its run."""

    variant: Variant
    record: Record

    @property
    def ratio(self) -> float:
        """Particle spacing over that of the scene that the variant is made from."""
        return self.variant.ratio

    @property
    def history(self) -> History:
        """Column -> values (n,) on rank 0; empty if the run did not finish."""
        return self.record.history if self.record.status == FINISHED else {}

    @property
    def seconds(self) -> float:
        """Processor time [s] of all ranks."""
        return self.record.seconds

    def with_ratio(self, ratio: float) -> "VariantRun":
        """The same run with its spacing over that of another scene."""
        return VariantRun(replace(self.variant, ratio=ratio), self.record)


class InProcess:
    """Runs variants on the ranks of this process, each in a folder below `folder`. All methods are collective."""

    def __init__(self, comm: MPI.Intracomm, folder: Path, limits: Limits | None = None) -> None:
        self.comm, self.folder, self.limits = comm, folder, limits or Limits()

    def run(self, variant: Variant, on_start: Callable[[], None] | None = None) -> VariantRun:
        """Read the run of a variant, or make it after a call of `on_start`. Raises Interrupted on all ranks.

        A scene that cannot be set up gives a record with the status "refused" and the message.
        """
        folder = self.folder / self.comm.bcast(variant.digest if self.comm.rank == 0 else None)
        record = self.read(folder)
        if record is None:
            if on_start is not None:
                on_start()
            try:
                run_into(self.comm, variant.scene, folder, self.limits)
            except (SceneError, SolverError) as error:
                return VariantRun(variant, Record(REFUSED, message=f"it cannot be set up: {error}"))
            record = self.read(folder)
            assert record is not None
        return VariantRun(variant, record)

    def read(self, folder: Path) -> Record | None:
        """The record of a finished or failed run, with its history on rank 0; None if there is no such run."""
        record = None
        with together(self.comm, f"cannot read {folder}"):
            if self.comm.rank == 0 and (folder / "summary.json").exists():
                summary, history = read_files(folder)
                if summary["status"] in (FINISHED, FAILED):
                    wall, processor = step_seconds(summary)
                    record = Record(summary["status"], history, summary, [wall], [processor], summary.get("fault"))
        without_history: Record | None = self.comm.bcast(None if record is None else replace(record, history={}))
        return record if self.comm.rank == 0 else without_history


def has_checkpoint(comm: MPI.Intracomm, folder: Path) -> bool:
    """Whether a folder holds a checkpoint, whole or partial. Collective."""
    name = folder / DEFAULT_NAME
    return anywhere(comm, any(path.exists() for path in (name, partial_name(name), previous_name(name))))


def run_into(comm: MPI.Intracomm, scene: Scene, folder: Path, limits: Limits) -> None:
    """Run a scene into a folder, from the checkpoint there if one can be read. Raises Interrupted. Collective."""
    restart = None
    if has_checkpoint(comm, folder):
        try:
            restart = Restart(comm, find_checkpoint(folder, comm))
        except OutputError:
            restart = None
    # frees the systems of the previous run, which hold reference cycles and large arrays
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
