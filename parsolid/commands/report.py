"""What `check` says: the field table, and the cost of a scene in memory, messages and time."""

import time as clock

import numpy as np

from parsolid.collective import maximum, minimum
from parsolid.output.summary import peak_memory_bytes


def print_report(comm, simulation) -> None:
    """Print the report on rank 0; collective. A few tiny steps measure the wall time of one."""
    method, scene = simulation.method, simulation.scene
    stable = minimum(comm, method.stable_step())
    counts = {"particles": method.owned} | method.numbers()
    numbers = {name: comm.gather(count) for name, count in counts.items()}
    pairs = comm.allreduce(method.directed_pairs) // 2
    sent = comm.allreduce(method.bytes_a_step())
    seconds = _seconds_a_step(comm, simulation, stable)
    memory = maximum(comm, peak_memory_bytes())
    if comm.rank > 0:
        return
    print(
        f"{scene.title or 'scene'}: {scene.method.kind}, {scene.dimension}-D, {comm.size} {'rank' if comm.size == 1 else 'ranks'}\n"
    )
    _print_fields(method)
    print()
    for name, values in numbers.items():
        print(f"{name:<28} {sum(values):>14,}   a rank: {', '.join(f'{value:,}' for value in values)}")
    steps = int(np.ceil(scene.end_time / stable))
    if pairs:
        print(f"{'pairs':<28} {pairs:>14,}")
    print(f"{'bytes a particle':<28} {bytes_a_particle(method):>14,.0f}   with all lists and work arrays")
    print(f"{'bytes sent a step':<28} {sent:>14,}   on all ranks")
    print(f"{'peak memory a rank':<28} {memory / 2**20:>14,.0f} MiB")
    print(f"{'time step':<28} {stable:>14.4g} s   now; it changes with the state")
    print(f"{'steps':<28} {steps:>14,}   to {scene.end_time:g} s")
    print(
        f"{'estimated wall time':<28} {steps * seconds:>14,.1f} s   {seconds * 1e3:.3g} ms a step, without output",
        flush=True,
    )


def _print_fields(method) -> None:
    names = f"{'field':<28} {'components':>10} {'unit':>8} {'bytes':>6}   roles"
    print(names + "\n" + "-" * len(names))
    for name, declared in method.table.fields.items():
        size = method.table.arrays[name].dtype.itemsize * declared.components
        print(f"{name:<28} {declared.components:>10} {declared.unit:>8} {size:>6}   {declared.roles}")
    for name, width in method.exchanged_records().items():
        print(f"{f'({name})':<28} {width:>10} {'':>8} {8 * width:>6}   exchanged")


def bytes_a_particle(method) -> float:
    """Memory of fields, work arrays and lists over this rank's particles [B]."""
    seen, total = set(), 0
    for array in [*method.table.arrays.values(), *method.arrays()]:
        base = array
        while base.base is not None and isinstance(base.base, np.ndarray):
            base = base.base
        if id(base) not in seen:
            seen.add(id(base))
            total += base.nbytes
    return total / max(1, method.owned)


def _seconds_a_step(comm, simulation, stable: float) -> float:
    """Measured wall time of a step [s]; collective."""
    small = 1e-6 * stable
    simulation.take_step(small)
    began = clock.perf_counter()
    for _ in range(3):
        simulation.take_step(small)
    return maximum(comm, (clock.perf_counter() - began) / 3.0)
