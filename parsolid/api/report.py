"""The report of `check`: fields, memory, messages, time and disk space of a scene."""

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.api.check_advice import advice
from parsolid.api.forecast import BESIDES, bytes_on_disk, load_on, memory_on, seconds_a_step
from parsolid.api.pictures import missing
from parsolid.api.scenes import AnyScene, read_scene, require_whole_number, scene_on_all_ranks
from parsolid.collective import SolverError, maximum, minimum
from parsolid.contact.report import describe_contacts
from parsolid.methods.protocol import ParticleSystem
from parsolid.output.summary import peak_memory_bytes
from parsolid.particles.meshes.slices import MeshSlices
from parsolid.scene import Scene
from parsolid.scene.codes import Note, Warned
from parsolid.scene.systems import settings_of_stages
from parsolid.simulation.loop import Simulation
from parsolid.simulation.warmup import load_kernels, warm_up

# fewest and most measured steps, and their time [s]
_STEPS, _SECONDS = (3, 200), 2.0
# number of parts of the measured steps, of which the median is taken
_STRETCHES = 10


@dataclass(frozen=True)
class Report:
    """The cost of a scene on the present ranks; `str()` is the output of `check`.

    particles, pairs: of all ranks; stable_step: the first time step [s]; steps: to the end of the scene with this step;
    seconds_a_step: measured wall time [s]; memory_a_rank: largest of all ranks [bytes]; bytes_on_disk: of fields and
    checkpoints; warnings, notes: with their codes; text: without them, on rank 0
    """

    particles: int
    pairs: int
    stable_step: float
    steps: int
    seconds_a_step: float
    memory_a_rank: int
    bytes_on_disk: float
    warnings: list[Warned]
    notes: list[Note]
    text: str

    def __str__(self) -> str:
        return self.lines()

    def lines(self, silence: Sequence[str] = ()) -> str:
        """The text with warnings and notes, but for those with the codes in `silence`."""
        remarks: list[Warned | Note] = [*self.warnings, *self.notes]
        return "\n".join([self.text, *(str(one) for one in remarks if one.code not in silence)])


def check_scene(
    comm: MPI.Intracomm, scene: Scene, elsewhere: int | None = None, picture: str | Path | None = None
) -> Report:
    """Set a scene up, take a few steps, and report its cost; only a picture is written. Collective.

    elsewhere: a number of ranks for which the cost is predicted; picture: a file into which bodies, regions, supports,
    loads and interfaces are drawn. Raises SceneError or SolverError on all ranks.
    """
    # shared, so that each mesh is read or made once
    meshes: dict[Any, MeshSlices] = {}
    if picture is not None:
        if missing():
            raise SolverError(f"picture: expected the packages {', '.join(missing())}, found them not installed")
        from parsolid.api.scene_picture import draw_scene

        draw_scene(comm, scene, picture, meshes)
    warm_up(comm, scene)
    base, idle = 0, 0.0
    if elsewhere:
        # time and memory of the program without particles
        idle = load_kernels(scene)
        base = peak_memory_bytes(present=True)
    return report_of(comm, Simulation(comm, scene, meshes=meshes), elsewhere, base, idle, meshes)


def check(
    scene: AnyScene, ranks: int | None = None, trust_code: bool = False, picture: str | Path | None = None
) -> Report:
    """Set a scene up and report its cost on the ranks of a script; only a picture is written. Collective.

    scene: as in `parsolid.run`; ranks: a number of ranks for which the cost is predicted; picture: a file (png, pdf,
    svg) into which bodies, regions, supports, loads and interfaces are drawn. Raises SceneError or SolverError.
    """
    comm = MPI.COMM_WORLD
    if ranks is not None:
        require_whole_number("ranks", ranks)
    return check_scene(comm, scene_on_all_ranks(comm, lambda: read_scene(scene, trust_code=trust_code)), ranks, picture)


def report_of(
    comm: MPI.Intracomm,
    simulation: Simulation,
    elsewhere: int | None = None,
    base: int = 0,
    idle: float = 0.0,
    meshes: dict[Any, MeshSlices] | None = None,
) -> Report:
    """The report on a simulation, which takes a few steps to measure their wall time; collective.

    elsewhere: a number of ranks for which the cost is predicted; base: memory [bytes] and idle: time of a step [s] of
    the program without particles; meshes: of bodies, cleared after use
    """
    meshes = {} if meshes is None else meshes
    systems, scene, notes = simulation.systems, simulation.scene, advice(simulation, meshes)
    meshes.clear()
    stable = minimum(comm, simulation.stable_step())
    counts: dict[str, int] = {}
    for system in systems:
        for name, count in ({"particles": system.owned} | system.numbers()).items():
            counts[name] = counts.get(name, 0) + count
    # name -> counts of all ranks
    numbers = {name: comm.gather(count) or [] for name, count in counts.items()}
    pairs = comm.allreduce(sum(system.directed_pairs for system in systems)) // 2
    sent = comm.allreduce(sum(system.bytes_a_step() for system in systems))
    measured = _Steps(comm, simulation, stable)
    seconds, work = measured.measure()
    fields, once, checkpoint = bytes_on_disk(comm, scene, systems)
    prediction = _elsewhere(measured, elsewhere, base, work, idle) if elsewhere else []
    memory, contacts = maximum(comm, peak_memory_bytes()), describe_contacts(comm, scene, systems)
    table = _table_of_systems(comm, simulation) if len(systems) > 1 else []
    steps = int(np.ceil(maximum(comm, max(system.steps_to(scene.end_time) for system in systems))))
    times = max(1, len(scene.fields_times))
    wall = f"{steps * seconds:>14,.1f} s   {seconds * 1e3:.3g} ms a step, without output"
    settings = settings_of_stages(scene) if scene.stages else [system.settings for system in scene.systems]
    adaptive = any(getattr(one, "integrator", "") in ("static", "implicit") for one in settings)
    if scene.stages or adaptive:
        # the number of steps, or their costs in later stages, are not known
        wall = f"{'unknown':>14}     {seconds * 1e3:.3g} ms a step, the median of the first ones, without output"
    ranks = f"{comm.size} {'rank' if comm.size == 1 else 'ranks'}"
    lines = []
    for system in systems:
        name = f" {system.name}," if system.name else ""
        lines += [f"{scene.title or 'scene'}:{name} {system.settings.kind}, {scene.dimension}-D, {ranks}", ""]
        lines += [*_fields(system), ""]
    lines += table
    for name, values in numbers.items():
        lines.append(f"{name:<28} {sum(values):>14,}   a rank: {', '.join(f'{value:,}' for value in values)}")
    lines += map(str, contacts)
    if pairs:
        lines.append(f"{'pairs':<28} {pairs:>14,}")
    lines += [
        f"{'bytes a particle':<28} {bytes_a_particle(systems):>14,.0f}   with all lists and work arrays",
        f"{'bytes sent a step':<28} {sent:>14,}   on all ranks",
        f"{'peak memory a rank':<28} {memory / 2**20:>14,.0f} MiB",
        f"{'time step':<28} {stable:>14.4g} s   now; it changes with the state",
        f"{'steps':<28} {steps:>14,}   {'at least, ' if adaptive else ''}to {scene.end_time:g} s",
        f"{'estimated wall time':<28} {wall}",
        f"{'fields':<28} {_mib(times * fields + once)}   {times} times of {fields / 2**20:.3g} MiB",
        f"{'checkpoints':<28} {_mib(2 * checkpoint)}   two of {checkpoint / 2**20:.3g} MiB",
        *prediction,
    ]
    return Report(
        particles=simulation.particles,
        pairs=pairs,
        stable_step=stable,
        steps=steps,
        seconds_a_step=seconds,
        memory_a_rank=memory,
        bytes_on_disk=times * fields + once + 2 * checkpoint,
        warnings=list(simulation.warnings),
        notes=notes,
        text="\n".join(lines),
    )


def _mib(size: float) -> str:
    return f"{size / 2**20:>14,.4g} MiB"


def _elsewhere(measured: "_Steps", ranks: int, base: int, work: float, idle: float) -> list[str]:
    """The predicted cost on another number of ranks, one core each; work, idle: time of a step [s] on the present ranks
    and without particles. Collective."""
    comm, systems = measured.comm, measured.simulation.systems
    now, then = load_on(comm, systems, comm.size), load_on(comm, systems, ranks)
    step, messages = seconds_a_step(systems, work, maximum(comm, idle), now, then, ranks)
    program = maximum(comm, base) + (BESIDES if comm.size == 1 < ranks else 0)
    memory = memory_on(program, maximum(comm, peak_memory_bytes()) + program - maximum(comm, base), now, then)
    parts = f"{step * 1e3:.4g} ms of the processor, {messages * 1e3:.3g} ms messages"
    return [
        f"\non {ranks} {'rank' if ranks == 1 else 'ranks'}, a core to each:",
        f"{'particles of a rank':<28} {then.particles:>14,.0f}   and {then.ghosts:,.0f} ghosts at most",
        f"{'memory a rank':<28} {_mib(memory)}   of which {program / 2**20:,.0f} MiB the program",
        f"{'time a step':<28} {(step + messages) * 1e3:>14,.4g} ms   of which {parts}",
    ]


def _table_of_systems(comm: MPI.Intracomm, simulation: Simulation) -> list[str]:
    """A line per system: particles, pairs, memory, stable step; collective."""
    title = f"{'system':<20} {'particles':>12} {'pairs':>12} {'bytes a particle':>17} {'time step':>12} {'steps':>10}"
    lines = [title, "-" * len(title)]
    for system in simulation.systems:
        particles, pairs = comm.allreduce(system.owned), comm.allreduce(system.directed_pairs) // 2
        memory = comm.allreduce(bytes_a_particle([system]) * system.owned) / max(1, particles)
        step = minimum(comm, system.stable_step())
        steps = int(np.ceil(simulation.scene.end_time / step))
        count = f"{particles:>12,} {pairs:>12,} {memory:>17,.0f} {step:>10.4g} s {steps:>10,}"
        lines.append(f"{system.name or system.settings.kind:<20} {count}")
    return [*lines, ""]


def _fields(system: ParticleSystem) -> list[str]:
    """A line per declared field and exchanged record."""
    names = f"{'field':<28} {'components':>10} {'unit':>8} {'bytes':>6}   roles"
    lines = [names, "-" * len(names)]
    for name, declared in system.particles.fields.items():
        size = system.particles.owned_rows(name).dtype.itemsize * declared.components
        lines.append(f"{name:<28} {declared.components:>10} {declared.unit:>8} {size:>6}   {declared.roles}")
    for name, width in system.exchanged_records().items():
        lines.append(f"{f'({name})':<28} {width:>10} {'':>8} {8 * width:>6}   exchanged")
    return lines


def bytes_a_particle(systems: list[ParticleSystem]) -> float:
    """Memory of fields, work arrays and lists over this rank's particles [B]."""
    seen, total = set(), 0
    for array in [a for system in systems for a in (*system.particles.storages(), *system.arrays())]:
        base = array
        while base.base is not None and isinstance(base.base, np.ndarray):
            base = base.base
        if id(base) not in seen:
            seen.add(id(base))
            total += base.nbytes
    return float(total) / max(1, sum(system.owned for system in systems))


class _Steps:
    """Measurement of the first steps of a run, with the step lengths of the run."""

    def __init__(self, comm: MPI.Intracomm, simulation: Simulation, stable: float) -> None:
        """Takes a first step of the length `stable` [s], which loads kernels. Collective."""
        self.comm, self.simulation, self.begin = comm, simulation, stable
        self.stable = stable
        self.take()

    def take(self) -> None:
        """One step; collective."""
        simulation, end = self.simulation, self.simulation.scene.end_time
        # a scene of few steps continues beyond its end
        ended = simulation.clock.time >= end or not self.stable > 0.0
        step = min(self.begin, end) if ended else simulation.time_steps.next(simulation.clock.time, self.stable)[0]
        self.stable = simulation.take_step(step)

    @property
    def _work(self) -> float:
        return self.simulation.clock.loop_processor_seconds - self.simulation.phases.sent_processor

    def measure(self) -> tuple[float, float]:
        """Wall time of a step [s], and processor time without messages on the busiest rank [s]; collective."""
        walls: list[float] = []
        work: list[float] = []
        # no more steps than needed beyond the end, where steps of equilibria cost little
        while len(walls) < _STEPS[0] or (
            self.simulation.clock.time < self.simulation.scene.end_time
            and len(walls) < _STEPS[1]
            and maximum(self.comm, sum(work)) < _SECONDS
        ):
            began, before = clock.perf_counter(), self._work
            self.take()
            walls.append(maximum(self.comm, clock.perf_counter() - began))
            work.append(self._work - before)
        return float(np.median(walls)), maximum(self.comm, median_of_means(work))


def median_of_means(seconds: list[float]) -> float:
    """The median of the means [s] of ten parts of the steps: it includes occasional new pair lists, but no disturbance
    by other programs."""
    return float(np.median([one.mean() for one in np.array_split(seconds, min(_STRETCHES, len(seconds)))]))
