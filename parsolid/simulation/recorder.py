"""What happens beside the stepping: history rows, fields, checkpoints, progress; when each is due."""

import time as clock
from typing import Any

from parsolid.output.checkpoint import write_checkpoint
from parsolid.output.errors import together
from parsolid.output.progress import Progress, Several
from parsolid.output.whereabouts import HERE
from parsolid.simulation.loop import Simulation
from parsolid.simulation.observables import Observables
from parsolid.simulation.output_files import OutputFiles
from parsolid.simulation.probes import Probes
from parsolid.simulation.reference import Errors
from parsolid.simulation.restart import header_of
from parsolid.simulation.run_summary import summary_of
from parsolid.simulation.scene_changes import contents
from parsolid.simulation.time_step import SLIVER


class Recorder:
    """Looks at a simulation after every step and writes what is due; created on all ranks."""

    def __init__(self, simulation: Simulation, files: OutputFiles, progress: Progress | Several | None):
        """files: `output_files.OutputFiles`; progress: `output.progress.Progress` or None on other ranks."""
        self.simulation, self.files, self.progress = simulation, files, progress
        self.scene = simulation.scene
        self.observables = Observables(simulation.systems)
        self.probes = Probes(simulation.comm, simulation.scene, self.observables)
        self.last_row: dict[str, float] | None = None
        self.errors = Errors(simulation.scene)
        # read when the run starts; rank 0's goes into checkpoints
        self.contents: dict[str, Any] = {}
        with together(simulation.comm, "cannot read a file of the scene"):
            if simulation.comm.rank == 0:
                self.contents = contents(simulation.scene)
        self.last_checkpoint_step: int | None = None
        self.last_checkpoint_wall = clock.perf_counter()
        self.resumed_step: int | None = None

    def resume(self, header: dict[str, Any]) -> None:
        """Continue from a checkpoint's header; what was due at its step has been written."""
        self.resumed_step = self.last_checkpoint_step = self.simulation.clock.step
        self.probes.restore(header["probes"])
        rows = self.files.history_rows(last_only=self.errors.reference is None)
        self.last_row = rows[-1] if rows else None
        self.errors.resume(rows, header["errors"])

    @property
    def columns(self) -> list[str]:
        """Columns of the history."""
        acting = [column for interaction in self.simulation.interactions for column in interaction.columns]
        return ["step", "time", "dt", *self.simulation.ledger.columns, *self.probes.columns, *acting]

    def look(self, simulation: Simulation) -> None:
        """Write what is due at the end of a step; collective when something is."""
        if simulation.clock.step == self.resumed_step:
            return
        time, step, end = simulation.clock.time, simulation.clock.step, simulation.clock.time >= self.scene.end_time
        if self._history_due(time, step) or end:
            self.write_history()
        if any(landing == time for landing in self.files.field_times):
            tools = {name: one for each in simulation.interactions for name, one in each.handed_on().items()}
            self.files.write_fields(self.observables, time, tools)
        self.errors.look(simulation, self.observables)
        if self._checkpoint_due(simulation):
            self.write_checkpoint()
        if self.progress is not None:
            self.progress.update(step, time, self.simulation.clock.step_size, self.last_row)

    def _history_due(self, time: float, step: int) -> bool:
        output = self.scene.output
        if self.simulation.clock.step_size == 0.0:
            # the start, and what a jump of the loads has done
            return True
        if output.history_steps is not None:
            return step % output.history_steps == 0
        interval = output.history_interval or self.scene.end_time / 200.0
        before = time - self.simulation.clock.step_size
        return int(time / interval * (1 + SLIVER)) > int(before / interval * (1 + SLIVER))

    def finish(self) -> None:
        """Write the checkpoint that the end of a run owes; collective."""
        began = clock.perf_counter()
        self.write_checkpoint()
        if self.simulation.clock.time >= self.scene.end_time:
            self.files.pack()
        self.simulation.phases.output += clock.perf_counter() - began

    def _checkpoint_due(self, simulation: Simulation) -> bool:
        output, step = self.scene.output, simulation.clock.step
        if step in (self.last_checkpoint_step, 0):
            return False
        if output.checkpoint_steps is not None and step % output.checkpoint_steps == 0:
            return True
        if output.checkpoint_interval is not None:
            time, before = simulation.clock.time, simulation.clock.time - self.simulation.clock.step_size
            interval = output.checkpoint_interval
            if int(time / interval * (1 + SLIVER)) > int(before / interval * (1 + SLIVER)):
                return True
        return simulation.checkpoint_wanted

    def wall_checkpoint_due(self) -> bool:
        """Whether this rank's clock says that a checkpoint is due; the ranks agree on it with the time step."""
        return clock.perf_counter() - self.last_checkpoint_wall > self.scene.output.checkpoint_wall

    def write_history(self) -> None:
        """One row of the ledger and the probes; collective."""
        now = self.simulation.clock
        row = {"step": now.step, "time": now.time, "dt": now.step_size} | self.simulation.energy_row()
        row |= dict(zip(self.probes.columns, self.probes.sample()))
        for interaction in self.simulation.interactions:
            row |= dict(zip(interaction.columns, interaction.sample()))
        self.last_row = row
        self.files.append_history([row[name] for name in self.columns])
        self.errors.note(row)

    def write_checkpoint(self) -> None:
        """Write a checkpoint now; collective."""
        simulation = self.simulation
        if self.files.checkpoint is None or simulation.clock.step == self.last_checkpoint_step:
            return
        # a method may pack its fields when it is asked for its state
        header = header_of(simulation, self.probes.state(), self.errors.found, self.contents)
        fields = [system.particles.checkpointed() for system in simulation.systems]
        write_checkpoint(simulation.comm, self.files.checkpoint, header, fields, simulation.ledger.values)
        self.last_checkpoint_step, self.last_checkpoint_wall = simulation.clock.step, clock.perf_counter()
        simulation.last_checkpoint = (
            f"{self.files.checkpoint} (step {simulation.clock.step}, t = {simulation.clock.time:.6g} s)"
        )
        HERE.checkpoint = simulation.last_checkpoint

    def summary(self, status: str) -> dict[str, Any]:
        """What summary.json says of the run; collective, the same on all ranks."""
        balance = None if self.last_row is None else self.last_row["balance"]
        return summary_of(self.simulation, status, balance, self.errors.result())
