"""One rank of each node compiles a scene's kernels before the others, which then load them from the file cache."""

import hashlib
import json
import time
from contextlib import suppress
from pathlib import Path

from mpi4py import MPI

from decomposition.compiled import folder
from parsolid.methods import method_class
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation
from parsolid.simulation.observables import Observables
from parsolid.sources import source_digest


def warm_up(comm, scene) -> None:
    """Compile on the first rank of each node, unless the cache has been warmed for such a scene; collective."""
    if comm.size == 1:
        return
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    tables = _small_scene(scene)
    if node.rank == 0:
        mark = _mark(tables)
        # an error of this rank alone would leave the others waiting; one of the scene's meets all ranks in a moment
        with suppress(Exception):
            _compile_unless_marked(mark, tables)
    wait_quietly(node)
    node.Free()


def _compile_unless_marked(mark: Path, tables: dict) -> None:
    if mark.exists():
        return
    compile_kernels(tables)
    mark.parent.mkdir(parents=True, exist_ok=True)
    mark.touch()


def wait_quietly(comm) -> None:
    """A barrier that sleeps instead of spinning, so that waiting ranks leave the processor to the working ones."""
    request = comm.Ibarrier()
    while not request.Test():
        time.sleep(0.01)


def compile_kernels(tables: dict) -> None:
    """Run one step of a small scene on this rank alone, and call what only several ranks need."""
    simulation = Simulation(MPI.COMM_SELF, parse_scene(tables))
    simulation.take_step(1e-9 * simulation.method.stable_step())
    method = simulation.method
    method.energies()
    Observables(method).field("pressure")
    method.warm()


def _mark(tables: dict) -> Path:
    text = source_digest() + json.dumps(tables, sort_keys=True)
    return folder() / f"warm-{hashlib.sha256(text.encode()).hexdigest()[:16]}"


def _small_scene(scene) -> dict:
    """A scene of a few particles whose kernels have the same types."""
    d, full = scene.dimension, scene.resolved()
    bodies = []
    for index, body in enumerate(full["bodies"]):
        lower = [10.0 * index] + [0.0] * (d - 1)
        box = {"lower": lower, "upper": [lower[0] + 1.0] + [1.0] * (d - 1)}
        bodies.append({"shape": {"box": box}, "particles": [3] * d, "placement": "nodes", "material": body["material"]})
    kinds = {boundary["kind"] for boundary in full["boundaries"]}
    boundaries = [{"plane": "Y = 0", "kind": kind} for kind in sorted(kinds & {"fixed", "roller", "antisymmetric"})[:1]]
    if "velocity" in kinds:
        boundaries.append({"plane": "Y = 1", "kind": "velocity", "velocity": [0.0] * d})
    loads = {"acceleration": [0.0] * d} if full.get("loads") or "traction" in kinds else {}
    small = {"dimension": d, "end_time": 1.0, "method": full["method"], "bodies": bodies, "boundaries": boundaries}
    return method_class(scene.method.kind).small_scene(small | {"loads": loads, "title": "warming up"})
