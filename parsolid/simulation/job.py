"""A run of a scene with its files in a folder: history, fields, checkpoints, summary."""

import time as clock
from collections.abc import Sequence
from typing import Any

from parsolid.output.crash_report import CONTEXT
from parsolid.output.errors import together
from parsolid.output.progress import Progress
from parsolid.output.run_folder import RunFolder
from parsolid.output.summary import provenance, write_summary
from parsolid.scene import dump_scene
from parsolid.simulation.field_output import FieldOutput
from parsolid.simulation.history import HistoryOutput
from parsolid.simulation.loop import Limits, RunFailed, Simulation
from parsolid.simulation.outputs import Output
from parsolid.simulation.reference import ReferenceErrors
from parsolid.simulation.restart import CheckpointOutput, Restart
from parsolid.simulation.run_summary import summary_of
from parsolid.simulation.signals import StopRequest

FAILED = "failed"


class ProgressOutput(Output):
    """Shows every state to the lines of progress that rank 0 has; they know themselves when one is due."""

    def __init__(self, lines: Sequence[Progress], history: HistoryOutput, warned: int):
        """warned: warnings that are known at the start."""
        self.lines, self.history, self._warned = lines, history, warned

    def due(self, simulation: Simulation) -> bool:
        return True

    def write(self, simulation: Simulation) -> None:
        now, new = simulation.clock, simulation.warnings[self._warned :]
        self._warned += len(new)
        for one in self.lines:
            for warning in new:
                one.say(str(warning))
            told = [word for system in simulation.systems for word in system.progress()]
            one.update(now.step, now.time, now.step_size, self.history.last_row, told)


class Job:
    """A simulation, its folder and its outputs, those of the scene first.

    simulation, folder, history, fields, checkpoints, errors: as they are named; outputs: all of them, in the order in
    which they are written.
    """

    def __init__(
        self,
        simulation: Simulation,
        folder: RunFolder,
        restart: Restart | None = None,
        progress: Sequence[Progress] = (),
        outputs: Sequence[Output] = (),
    ):
        """restart: what the simulation continues; progress: of rank 0; outputs: more than the scene's. Collective."""
        comm, scene = simulation.comm, simulation.scene
        self.simulation, self.folder, self.progress = simulation, folder, progress
        with together(comm, f"cannot write {folder.scene}"):
            if comm.rank == 0:
                dump_scene(scene, folder.scene)
        if restart:
            # before anything is read that may be damaged: a failure tells it
            simulation.last_checkpoint = CONTEXT.checkpoint = str(restart.path)
        self.history = HistoryOutput(simulation, folder)
        self.fields = FieldOutput(simulation, folder)
        self.errors = ReferenceErrors(scene, self.history)
        self.checkpoints = CheckpointOutput(simulation, folder, self.history, self.errors)
        shown = ProgressOutput(progress, self.history, len(simulation.warnings))
        self.outputs = [self.history, self.fields, self.errors, *outputs, self.checkpoints, shown]
        if restart:
            rows = self.history.resume(restart.header["probes"], self.errors.every_row)
            self.errors.resume(rows, restart.header["errors"])
            for one in self.outputs:
                # what was due at the checkpoint's step has been written
                one.last_step = simulation.clock.step

    def run(self, limits: Limits | None = None, stop: StopRequest | None = None) -> dict[str, Any]:
        """Run to the scene's end or to a limit, and `end`; the summary. Collective.

        Raises RunFailed on all ranks, once the summary is written.
        """
        try:
            status = self.simulation.run(None, self.outputs, limits, stop)
        except RunFailed as failure:
            self.end(FAILED, str(failure).splitlines()[0])
            raise
        return self.end(status)

    def end(self, status: str, fault: str | None = None) -> dict[str, Any]:
        """Write the last checkpoint, unless there is a fault, and summary.json; the summary. Collective."""
        if fault is None:
            self.finish()
        summary = self.summary(status) | ({} if fault is None else {"fault": fault})
        with together(self.simulation.comm, f"cannot write {self.folder.summary}"):
            if self.simulation.comm.rank == 0:
                write_summary(self.folder.summary, summary | provenance())
        for one in self.progress:
            one.close(summary)
        return summary

    def finish(self) -> None:
        """Write the checkpoint that the end of a run owes, and deflate fields of which no more come; collective."""
        began = clock.perf_counter()
        self.checkpoints.write_last(self.simulation)
        if self.simulation.clock.time >= self.simulation.scene.end_time:
            self.fields.pack()
        self.simulation.phases.output += clock.perf_counter() - began

    def summary(self, status: str) -> dict[str, Any]:
        """What summary.json says of the run; collective, the same on all ranks."""
        row = self.history.last_row
        energy_error = None if row is None else row["energy_error"]
        return summary_of(self.simulation, status, energy_error, self.errors.result())

    def close(self) -> None:
        """Close the files, on each rank for itself."""
        self.history.close()
