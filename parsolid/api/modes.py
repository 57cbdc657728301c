"""Frequencies and shapes of the vibrations of a scene's bodies, written into a folder."""

import csv
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.api.scenes import AnyScene, read_scene, require_part, require_whole_number, scene_on_all_ranks
from parsolid.collective import SolverError, maximum
from parsolid.output.errors import OutputError, together
from parsolid.output.fields import FieldSeries
from parsolid.output.run_folder import RunFolder
from parsolid.output.summary import provenance, write_summary
from parsolid.scene import Scene, dump_scene
from parsolid.scene.codes import Note
from parsolid.simulation.vibrations import VibratingBodies, Vibrations

# tolerance of residuals, with which separate frequencies are accurate to about 1e-9; most iterations
TOLERANCE, ITERATIONS = 1e-4, 500
# largest displacement of a shape in files, over the largest side of all bodies
_AMPLITUDE = 0.05


@dataclass(frozen=True)
class ModesFound:
    """Result of `modes`, the same on all ranks but for a note on moved results.

    frequencies (k,) [Hz], rigid modes first; rigid: their number; residuals (k,); shares (k, d): effective modal mass
    over the mass, along each axis; iterations, products, particles; converged; seconds; notes; folder: of tables and
    shapes, or None
    """

    frequencies: np.ndarray
    rigid: int
    residuals: np.ndarray
    shares: np.ndarray
    iterations: int
    products: int
    particles: int
    converged: bool
    seconds: float
    notes: tuple[Note, ...]
    folder: Path | None


def modes(
    scene: AnyScene,
    count: int = 10,
    output: str | Path | None = None,
    *,
    tolerance: float = TOLERANCE,
    trust_code: bool = False,
) -> ModesFound:
    """The rigid modes of a scene's bodies and the lowest `count` other modes about the initial state. Collective.

    scene: a Scene, a TOML file, or tables; output: a folder for tables and shapes, or None; tolerance: of residuals.
    Raises SceneError or SolverError for bad input, OutputError.
    """
    require_whole_number("count", count)
    require_part("tolerance", tolerance)
    comm = MPI.COMM_WORLD
    stated = scene_on_all_ranks(comm, lambda: read_scene(scene, trust_code=trust_code))
    inputs = (str(scene),) if isinstance(scene, str | Path) else ()
    return find_modes(comm, stated, count, None if output is None else Path(output), tolerance, inputs)


def find_modes(
    comm: Any,
    scene: Scene,
    count: int,
    folder: Path | None,
    tolerance: float = TOLERANCE,
    inputs: tuple[Path | str, ...] = (),
) -> ModesFound:
    """The modes of a Scene, see `modes`; inputs: files that must not be overwritten. Collective."""
    began = MPI.Wtime()
    bodies = VibratingBodies(comm, scene)
    notes = bodies.notes()
    with ExitStack() as resources:
        opened = None
        if folder is not None:
            try:
                opened = resources.enter_context(closing(RunFolder(comm, folder, inputs=inputs)))
            except OutputError as error:
                raise SolverError(str(error)) from error
            notes += [
                Note("results-moved", f"the results of an earlier run are in {aside} now") for aside in opened.moved
            ]
        found = bodies.find(count, tolerance, ITERATIONS)
        result = ModesFound(
            frequencies=found.frequencies,
            rigid=found.rigid,
            residuals=found.residuals,
            shares=found.shares,
            iterations=found.found.iterations,
            products=found.found.products,
            particles=bodies.particles,
            converged=found.found.converged,
            seconds=MPI.Wtime() - began,
            notes=tuple(notes),
            folder=folder,
        )
        if opened is not None:
            _write(comm, bodies, found, result, opened)
    return result


def rows_of(found: ModesFound) -> list[dict[str, Any]]:
    """A row per mode: number, kind, frequency, residual, shares."""
    return [
        {
            "mode": number + 1,
            "kind": "rigid" if number < found.rigid else "elastic",
            "frequency": float(found.frequencies[number]),
            "residual": float(found.residuals[number]),
            **{f"share_{axis}": float(share) for axis, share in zip("xyz", found.shares[number])},
        }
        for number in range(len(found.frequencies))
    ]


def _write(comm: Any, bodies: VibratingBodies, found: Vibrations, result: ModesFound, folder: RunFolder) -> None:
    """Write tables and scene on rank 0 and shapes on all ranks; collective."""
    rows = rows_of(result)
    with together(comm, f"cannot write to {folder.directory}"):
        if comm.rank == 0:
            dump_scene(bodies.scene, folder.scene)
            with (folder.directory / "modes.csv").open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, list(rows[0]) if rows else ["mode"])
                writer.writeheader()
                writer.writerows(rows)
            counts = {name: getattr(result, name) for name in ("particles", "rigid", "iterations", "products")}
            entries = {"title": bodies.scene.title, **counts, "converged": result.converged, "modes": rows}
            write_summary(folder.directory / "modes.json", entries | provenance())
    # one time of the fields per mode; the time is the number of the mode
    particles, places = bodies.system.particles, bodies.places
    series = FieldSeries(comm, folder.fields, max(1, len(found.shapes)))
    numbers = np.asarray(bodies.system.bodies, np.int32)[particles.owned_rows("body")]
    constant = {"body": numbers, "volume": particles.owned_rows("volume")}
    for number, shape in enumerate(found.shapes):
        largest = maximum(comm, float(np.linalg.norm(shape, axis=1).max(initial=0.0)))
        displacement = shape * (_AMPLITUDE * bodies.size / largest)
        varying = {"displacement": displacement}
        series.write(number + 1.0, particles.owned_rows("identifier"), places + displacement, varying, constant)
