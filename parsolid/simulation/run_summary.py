"""What summary.json says of a run."""

import time as clock
from typing import Any

import numpy as np

from parsolid.collective import maximum
from parsolid.output.summary import peak_memory_bytes
from parsolid.scene.systems import qualify_keys, settings_of_stages
from parsolid.simulation.loop import Simulation
from parsolid.simulation.phases import of_all_ranks


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
        qualify_keys(scene, plans[s.bodies], doubt) for s in systems if (doubt := s.validity_warning()) is not None
    ]
    # without messages and the first step
    worked = spent.loop_processor_seconds - spent.first_step_processor_seconds - simulation.phases.sent_processor
    of_methods: dict[str, Any] = {}
    for number, system in enumerate(systems):
        # those of a further system of the same method with its number
        found = system.summary()
        of_methods |= {f"{name}_{number}" if name in of_methods else name: value for name, value in found.items()}
    momenta = (0.0, 0.0) if simulation.momenta is None else simulation.momenta.shares()
    return {
        "scene": scene.title,
        "method": " and ".join(dict.fromkeys(system.settings.kind for system in systems)),
        "dimension": scene.dimension,
        "particles": simulation.particles,
        "pairs": pairs // 2,
        "mass": comm.allreduce(sum(float(s.mass[: s.owned] @ s.share[: s.owned]) for s in systems)),
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
