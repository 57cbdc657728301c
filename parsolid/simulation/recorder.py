"""What happens beside the stepping: history rows, fields, checkpoints, progress; when each is due."""

import time as clock

import numpy as np

from parsolid.collective import maximum
from parsolid.output.checkpoint import write_checkpoint
from parsolid.output.summary import peak_memory_bytes
from parsolid.simulation.probes import Probes
from parsolid.simulation.reference import Errors
from parsolid.simulation.restart import header_of

# landing on an output time may stretch or halve steps but never makes a sliver
_SLIVER = 1e-9


class Recorder:
    """Looks at a simulation after every step and writes what is due; created on all ranks."""

    def __init__(self, simulation, files, progress):
        """files: `output_files.OutputFiles`; progress: `output.progress.Progress` or None on other ranks."""
        self.simulation, self.files, self.progress = simulation, files, progress
        self.scene = simulation.scene
        self.probes = Probes(simulation.comm, simulation.scene, simulation.method)
        self.began = clock.perf_counter()
        self.last_row: dict | None = None
        self.errors = Errors(simulation.scene)
        self.step_size = 0.0
        self.output_seconds = 0.0
        self.last_checkpoint_step: int | None = None
        self.last_checkpoint_wall = clock.perf_counter()
        self.largest_energy = 0.0
        self.resumed_step: int | None = None

    def resume(self, header: dict) -> None:
        """Continue from a checkpoint's header; what was due at its step has been written."""
        self.resumed_step = self.last_checkpoint_step = self.simulation.clock.step
        self.largest_energy = header["largest_energy"]
        self.probes.restore(header["probes"])
        rows = self.files.history_rows(last_only=self.errors.reference is None)
        self.last_row = rows[-1] if rows else None
        self.errors.resume(rows, header["errors"])

    @property
    def columns(self) -> list[str]:
        """Columns of the history."""
        return ["step", "time", "dt", *self.simulation.ledger.columns, *self.probes.columns]

    def clip(self, time: float, stable: float) -> tuple[float, float]:
        """(step, time it leads to) [s]: at most the stable step, landing exactly on field times and the end; of length 0 where that is 0."""
        if stable == 0.0:
            self.step_size = 0.0
            return 0.0, time
        target = self._next_landing(time)
        remaining = target - time
        if remaining <= stable * (1.0 + _SLIVER):
            step, arrival = remaining, target
        elif self.simulation.method.even_steps:
            step = remaining / np.ceil(remaining / stable / (1.0 + _SLIVER))
            arrival = time + step
        elif remaining < 2.0 * stable:
            step, arrival = 0.5 * remaining, time + 0.5 * remaining
        else:
            step, arrival = stable, time + stable
        self.step_size = step
        return step, arrival

    def _next_landing(self, time: float) -> float:
        method = self.simulation.method
        landings = (*self.files.field_times, *self.errors.times, *method.landings, *method.jumps)
        later = [landing for landing in landings if landing > time]
        return min([*later, self.scene.end_time])

    def look(self, simulation) -> None:
        """Write what is due at the end of a step; collective when something is."""
        began = clock.perf_counter()
        if simulation.clock.step == self.resumed_step:
            return
        time, step, end = simulation.clock.time, simulation.clock.step, simulation.clock.time >= self.scene.end_time
        if self._history_due(time, step) or end:
            self.write_history()
        if any(landing == time for landing in self.files.field_times):
            self.files.write_fields(simulation, time)
        self.errors.look(simulation, self.probes.observables)
        if self._checkpoint_due(simulation):
            self.write_checkpoint()
        if self.progress is not None:
            self.progress.update(step, time, self.step_size, self.last_row)
        self.output_seconds += clock.perf_counter() - began

    def _history_due(self, time: float, step: int) -> bool:
        output = self.scene.output
        if self.step_size == 0.0:
            # the start, and what a jump of the loads has done
            return True
        if output.history_steps is not None:
            return step % output.history_steps == 0
        interval = output.history_interval or self.scene.end_time / 200.0
        before = time - self.step_size
        return int(time / interval * (1 + _SLIVER)) > int(before / interval * (1 + _SLIVER))

    def finish(self) -> None:
        """Write the checkpoint that the end of a run owes; collective."""
        self.write_checkpoint()

    def _checkpoint_due(self, simulation) -> bool:
        output, step = self.scene.output, simulation.clock.step
        if step == self.last_checkpoint_step or step == 0:
            return False
        if output.checkpoint_steps is not None and step % output.checkpoint_steps == 0:
            return True
        if output.checkpoint_interval is not None:
            time, before = simulation.clock.time, simulation.clock.time - self.step_size
            interval = output.checkpoint_interval
            if int(time / interval * (1 + _SLIVER)) > int(before / interval * (1 + _SLIVER)):
                return True
        return simulation.checkpoint_wanted

    def wall_checkpoint_due(self) -> bool:
        """Whether this rank's clock says that a checkpoint is due; the ranks agree on it with the time step."""
        return clock.perf_counter() - self.last_checkpoint_wall > self.scene.output.checkpoint_wall

    def write_history(self) -> None:
        """One row of the ledger and the probes; collective."""
        simulation = self.simulation
        row = {"step": simulation.clock.step, "time": simulation.clock.time, "dt": self.step_size}
        row |= simulation.ledger.row(simulation.comm, *simulation.method.energies())
        row |= dict(zip(self.probes.columns, self.probes.sample()))
        self.last_row = row
        self.files.append_history([row[name] for name in self.columns])
        self.errors.note(row)
        self._check_balance(row)

    def _check_balance(self, row: dict) -> None:
        """Note a balance that is broken beyond what any stable run shows."""
        energies = [abs(row[name]) for name in ("kinetic", "stored", "work_external")]
        self.largest_energy = max(self.largest_energy, *energies)
        round_off = 1e-12 * self.simulation.method.energy_scale + np.finfo(float).tiny
        if not abs(row["balance"]) <= 0.2 * self.largest_energy + round_off:
            self.simulation.broken_balance = row["balance"]

    def write_checkpoint(self) -> None:
        """Write a checkpoint now; collective."""
        simulation = self.simulation
        if self.files.checkpoint is None or simulation.clock.step == self.last_checkpoint_step:
            return
        fields = simulation.method.table.checkpointed()
        write_checkpoint(
            simulation.comm, self.files.checkpoint, header_of(simulation, self), fields, simulation.ledger.values
        )
        self.last_checkpoint_step, self.last_checkpoint_wall = simulation.clock.step, clock.perf_counter()
        simulation.last_checkpoint = (
            f"{self.files.checkpoint} (step {simulation.clock.step}, t = {simulation.clock.time:.6g} s)"
        )

    def summary(self, status: str) -> dict:
        """What summary.json says of the run; collective, the same on all ranks."""
        simulation, method, comm = self.simulation, self.simulation.method, self.simulation.comm
        clock_, steps = simulation.clock, simulation.clock.step - simulation.first_step
        directed, slowest, waited, memory = maximum_and_sums(
            comm, method.directed_pairs, clock_.loop_seconds, method.communication_seconds + clock_.waiting_seconds
        )
        rate = simulation.particles * steps / slowest / comm.size if steps else None
        evaluations = steps * method.evaluations
        return {
            "scene": self.scene.title,
            "method": self.scene.method.kind,
            "dimension": self.scene.dimension,
            "particles": simulation.particles,
            "pairs": directed // 2,
            "ranks": comm.size,
            "steps": simulation.clock.step,
            "end_time": clock_.time,
            "wall_seconds": clock.perf_counter() - clock_.began,
            "setup_seconds": simulation.setup_seconds,
            "loop_seconds": slowest,
            "loop_processor_seconds": comm.allreduce(clock_.loop_processor_seconds),
            "first_step_seconds": maximum(comm, clock_.first_step_seconds),
            "first_step_processor_seconds": comm.allreduce(clock_.first_step_processor_seconds),
            "output_seconds": self.output_seconds,
            "particle_steps_per_second_per_rank": rate,
            "nanoseconds_per_pair": slowest * comm.size / (evaluations * directed / 2) * 1e9
            if steps and directed
            else None,
            "communication_share": waited / (slowest * comm.size) if steps else None,
            "energy_balance": self._relative_balance(),
            "peak_memory_bytes_per_rank": memory,
            **method.summary(),
            "status": status,
            "errors": self.errors.result(),
        }

    def _relative_balance(self) -> float | None:
        """Energy balance of the last history row over the largest energy seen; over the method's scale where that is round-off."""
        scale, least = self.largest_energy, self.simulation.method.energy_scale
        if scale <= 1e-12 * least:
            scale = least
        return self.last_row["balance"] / scale if self.last_row is not None and scale > 0.0 else None


def maximum_and_sums(comm, pairs: int, seconds: float, waited: float) -> tuple[int, float, float, int]:
    """Pairs of all ranks, seconds of the slowest rank, seconds waited on all ranks, memory [B] of the largest rank."""
    return comm.allreduce(pairs), maximum(comm, seconds), comm.allreduce(waited), maximum(comm, peak_memory_bytes())
