"""A run of a scene with its files in a folder: history, fields, checkpoints, summary."""

import time as clock
from collections.abc import Sequence
from typing import Any

import numpy as np

from parsolid.collective import maximum
from parsolid.output.crash_report import CONTEXT
from parsolid.output.errors import together
from parsolid.output.progress import Progress
from parsolid.output.run_folder import RunFolder
from parsolid.output.summary import peak_memory_bytes, provenance, write_summary
from parsolid.scene import dump_scene
from parsolid.scene.systems import qualify_keys, settings_of_stages
from parsolid.simulation.field_output import FieldOutput
from parsolid.simulation.history import HistoryOutput
from parsolid.simulation.loop import Limits, RunFailed, Simulation
from parsolid.simulation.outputs import Output
from parsolid.simulation.phases import of_all_ranks
from parsolid.simulation.reference import ReferenceErrors
from parsolid.simulation.restart import CheckpointOutput, Restart
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


def summary_of(
    simulation: Simulation, status: str, energy_error: float | None, errors: dict[str, float]
) -> dict[str, Any]:
    """The summary; energy_error: of the last history row [J]; collective, the same on all ranks."""
    comm, scene, spent, systems = simulation.comm, simulation.scene, simulation.clock, simulation.systems
    check = simulation.energy_check
    steps, ranks = spent.step - simulation.first_step, comm.size
    pairs = comm.allreduce(sum(system.directed_pairs for system in systems))
    evaluated = comm.allreduce(sum(system.evaluations * system.directed_pairs for system in systems)) * steps
    slowest = maximum(comm, spent.loop_seconds)
    wall = clock.perf_counter() - spent.began
    mine = simulation.phases.seconds(spent.first_step_seconds, spent.loop_seconds)
    plans = {plan.bodies: plan for plan in scene.systems}
    doubts = [
        qualify_keys(scene, plans[system.bodies], doubt)
        for system, doubt in zip(systems, simulation.validity_warnings())
        if doubt is not None
    ]
    # without messages and the first step
    worked = spent.loop_processor_seconds - spent.first_step_processor_seconds - simulation.phases.sent_processor
    of_methods: dict[str, Any] = {}
    for number, system in enumerate(systems):
        # those of a further system of the same method with its number
        found = system.summary()
        of_methods |= {f"{name}_{number}" if name in of_methods else name: value for name, value in found.items()}
    inertias = [comm.allreduce(float(s.mass[: s.owned] @ s.share[: s.owned])) for s in systems]
    inertia = sum(inertias)
    mass = sum(one / s.settings.inertia_factor for one, s in zip(inertias, systems))
    momenta = (0.0, 0.0) if simulation.momenta is None else simulation.momenta.shares()
    return {
        "scene": scene.title,
        "method": " and ".join(dict.fromkeys(system.settings.kind for system in systems)),
        "dimension": scene.dimension,
        "particles": simulation.particles,
        "pairs": pairs // 2,
        "mass": mass,
        "ranks": ranks,
        "steps": spent.step,
        "steps_this_run": steps,
        "end_time": spent.time,
        "wall_seconds": wall,
        "setup_seconds": simulation.setup_seconds,
        "loop_seconds": slowest,
        "loop_processor_seconds": comm.allreduce(spent.loop_processor_seconds),
        "first_step_seconds": maximum(comm, spent.first_step_seconds),
        "first_step_processor_seconds": comm.allreduce(spent.first_step_processor_seconds),
        "output_seconds": simulation.phases.output,
        "particle_steps_per_second_per_rank": simulation.particles * steps / slowest / ranks if steps else None,
        "nanoseconds_per_pair": slowest * ranks / (evaluated / 2) * 1e9 if evaluated else None,
        **of_all_ranks(comm, mine, wall, max(0.0, worked)),
        "energy_error_share": None if energy_error is None else check.relative(energy_error, simulation.energy_scale),
        **check.verdict(simulation.energy_scale, doubts, momenta, simulation.warnings),
        "warnings": [{"code": one.code, "text": one.text} for one in simulation.warnings],
        "peak_memory_bytes_per_rank": maximum(comm, peak_memory_bytes()),
        **of_methods,
        **_of_several(simulation, steps),
        **_of_stages(simulation),
        **({"added_mass": inertia - mass, "kinetic_share": check.kinetic_share} if check.scaled else {}),
        "status": status,
        "errors": errors,
    }


def _of_stages(simulation: Simulation) -> dict[str, Any]:
    """Of each stage that has begun: when [s], its integrator, and the steps that it has taken."""
    scene, began = simulation.scene, simulation.stage_steps
    if not scene.stages:
        return {}
    times, counts = [0.0, *(one.start for one in scene.stages)], np.diff([*began, simulation.clock.step])
    named = zip(times, settings_of_stages(scene), counts.tolist())
    return {"stages": [{"start": time, "integrator": one.integrator, "steps": steps} for time, one, steps in named]}


def _of_several(simulation: Simulation, steps: int) -> dict[str, Any]:
    """Of each of several systems: its name, method, bodies, particles and pairs, nanoseconds of work a particle and
    step, and the work of the busiest rank over the mean; and that of all systems together; collective.
    """
    comm, systems, work = simulation.comm, simulation.systems, simulation.clock.work
    if len(systems) < 2:
        return {}
    rows = []
    for system, seconds in zip(systems, work):
        particles, total = comm.allreduce(system.owned), comm.allreduce(seconds)
        row = {"name": system.name, "method": system.settings.kind, "bodies": list(system.bodies)}
        row |= {"particles": particles, "pairs": comm.allreduce(system.directed_pairs) // 2}
        row["nanoseconds_per_particle_step"] = total * 1e9 / (particles * (steps - 1)) if steps > 1 else None
        row["work_imbalance"] = maximum(comm, seconds) * comm.size / total if total else None
        rows.append(row)
    mine, every = sum(work), comm.allreduce(sum(work))
    return {"systems": rows, "work_imbalance": maximum(comm, mine) * comm.size / every if every else None}
