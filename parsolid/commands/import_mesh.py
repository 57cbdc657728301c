"""`parsolid import`: converts a mesh file into an HDF5 file of which every rank of a run reads its part."""

from typing import Any

from parsolid.collective import SolverError
from parsolid.particles.meshes.imported import Contents, import_mesh
from parsolid.scene.validation_errors import SceneError


def add_arguments(parser: Any) -> None:
    """Add the command's arguments to an argparse parser."""
    parser.add_argument("mesh", metavar="MESH", help="a mesh file that meshio reads")
    parser.add_argument("target", metavar="FILE.h5", help="a new file, for shape = { mesh = ... }")


def run_import(comm: Any, options: Any) -> int:
    """Import a mesh; exit status 0. Collective: rank 0 works. Raises SolverError on all ranks."""
    fault = None
    if comm.rank == 0:
        try:
            contents, arrays = import_mesh(options.mesh, options.target)
            print(f"{options.target}: {describe(contents, arrays)}", flush=True)
        except SceneError as error:
            fault = "\n".join(error.faults)
        except OSError as error:
            fault = f"target: expected a file that can be written, found {options.target} ({error.strerror or error})"
    fault = comm.bcast(fault)
    if fault is not None:
        raise SolverError(fault)
    return 0


def describe(contents: Contents, arrays: Any) -> str:
    """Numbers of nodes and elements and names of groups of an imported mesh."""
    counts: dict[str, int] = {}
    for block, kind in enumerate(contents.kinds):
        counts[kind] = counts.get(kind, 0) + len(arrays[f"elements/{block}"])
    elements = ", ".join(f"{count:,} {kind}" for kind, count in counts.items())
    groups = sorted({*contents.nodes, *contents.elements, *(name for name, _ in contents.facets)})
    names = ", ".join(map(repr, groups)) or "none"
    return f"{len(arrays['points']):,} nodes, {elements} in {contents.dimension}-D; groups: {names}"
