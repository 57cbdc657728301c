"""One rank of each node compiles a scene's kernels before the others, which then load them from the file cache."""

import hashlib
import json
import time
from contextlib import suppress
from statistics import median
from typing import Any

from mpi4py import MPI

from parsolid.kernel_cache import cache_folder
from parsolid.materials.registry import loaded_texts
from parsolid.methods.small_scene import Tables, small_scene
from parsolid.observables.declared import field_of
from parsolid.scene import Scene, parse_scene
from parsolid.simulation.loop import Simulation

# of a small scene, to measure one
_IDLE_STEPS = 9


def warm_up(comm: Any, scene: Scene) -> None:
    """Compile on the first rank of each node, unless the cache has been warmed for such a scene; collective."""
    if comm.size == 1:
        return
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    tables = [small_scene(scene.part(system), system.settings) for system in scene.systems]
    if node.rank == 0:
        for table in tables:
            # an error of this rank alone would leave the others waiting; one of the scene's meets all ranks in a moment
            with suppress(Exception):
                text = loaded_texts() + json.dumps(table, sort_keys=True)
                mark = cache_folder() / f"warm-{hashlib.sha256(text.encode()).hexdigest()[:16]}"
                if not mark.exists():
                    compile_kernels(table)
                    mark.parent.mkdir(parents=True, exist_ok=True)
                    mark.touch()
    wait_quietly(node)
    node.Free()


def load_kernels(scene: Scene) -> float:
    """Have a scene's kernels in this rank's memory; the processor's seconds [s] of a step that has nearly no
    particles, which do not fall with the number of ranks.
    """
    idle = 0.0
    for system in scene.systems:
        with suppress(Exception):
            simulation = compile_kernels(small_scene(scene.part(system), system.settings))
            step, spent = 1e-9 * simulation.stable_step(), []
            for _ in range(_IDLE_STEPS):
                began = time.process_time()
                simulation.take_step(step)
                spent.append(time.process_time() - began)
            idle += median(spent)
    return idle


def wait_quietly(comm: Any) -> None:
    """A barrier that sleeps instead of spinning, so that waiting ranks leave the processor to the working ones."""
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(0.01)


def compile_kernels(tables: Tables) -> Simulation:
    """Run one step of a small scene on this rank alone; the simulation."""
    simulation = Simulation(MPI.COMM_SELF, parse_scene(tables, again=True))
    for system in simulation.systems:
        simulation.take_step(1e-9 * system.stable_step())
        system.energies()
        field_of(system, "pressure")
    return simulation
